//! Applies the commands of control to the bridges. If control sends no command for three control periods, all bridges
//! coast.

use super::{Health, Task, Wires};
use crate::board::Bridges;
use crate::bridge::Drive;
use crate::units::Period;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, with_timeout};

/// Number of control periods without a bridge command after which the bridges coast.
pub const DRIVE_TIMEOUT_PERIODS: u64 = 3;

/// Runs the task. Never returns.
///
/// The task checks in when it applies a command of control. If control stops sending commands, neither of the two tasks
/// checks in, and the watchdog resets the chip.
pub async fn run<M: RawMutex, const N: usize>(
    mut bridges: impl Bridges<N>,
    period: Period,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let timeout = Duration::from_micros(DRIVE_TIMEOUT_PERIODS * period.as_micros());
    bridges.apply(&[Drive::COAST; N]);
    loop {
        match with_timeout(timeout, wires.drives.wait()).await {
            Ok(drives) => {
                bridges.apply(&drives);
                health.check_in(Task::Output);
            }
            Err(_) => bridges.apply(&[Drive::COAST; N]),
        }
    }
}
