//! What bridges say of themselves, on a board that can hear it: faults and currents, every 25 ms, to control.

use super::{Health, Task, Wires};
use crate::board::{BridgeFaults, CurrentSense};
use crate::bridge::Sensed;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Ticker};

/// The sampling interval. A bridge that has switched itself off stays off until it is told to, so none is missed, and
/// it is safe by itself. A mean current follows its bridge within two milliseconds, and is of use to what takes seconds: a
/// winding's heat, a host's alert. Twice in the default period, it is never older than what is modelled at a tick.
pub const SENSE_INTERVAL: Duration = Duration::from_millis(25);

/// Runs for ever. A board that only hears faults has `()` for its currents.
pub async fn run<M: RawMutex, const N: usize>(
    mut faults: impl BridgeFaults<N>,
    mut currents: impl CurrentSense<N>,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let mut ticker = Ticker::every(SENSE_INTERVAL);
    loop {
        let mut sensed = currents.sample().await.map(|current| Sensed { current, fault: false });
        for (sensed, fault) in sensed.iter_mut().zip(faults.faults()) {
            sensed.fault = fault;
        }
        wires.sensed.signal(sensed);
        health.check_in(Task::Bridges);
        ticker.next().await;
    }
}
