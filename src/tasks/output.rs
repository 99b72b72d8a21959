//! Bridge output: drives go to the bridges as they come; when they stop coming, all bridges coast.

use super::{Health, Task, Wires};
use crate::board::Bridges;
use crate::bridge::Drive;
use crate::units::Period;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, with_timeout};

/// Control periods without a drive after which the bridges coast.
pub const PATIENCE_PERIODS: u64 = 3;

/// Runs for ever.
///
/// Checks in with every drive that it passes on: while it makes the bridges coast it is alive, but
/// control is not, and the watchdog hears from neither.
pub async fn run<M: RawMutex, const N: usize>(
    mut bridges: impl Bridges<N>,
    period: Period,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let patience = Duration::from_micros(PATIENCE_PERIODS * period.as_micros());
    bridges.apply(&[Drive::COAST; N]);
    loop {
        match with_timeout(patience, wires.drives.wait()).await {
            Ok(drives) => {
                bridges.apply(&drives);
                health.check_in(Task::Output);
            }
            Err(_) => bridges.apply(&[Drive::COAST; N]),
        }
    }
}
