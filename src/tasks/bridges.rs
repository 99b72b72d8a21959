//! Samples the fault outputs and the currents of the bridges for control, on boards that have these signals.

use super::{Health, Task, Wires};
use crate::board::BridgeSensors;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Ticker};

/// Sampling interval.
///
/// A bridge that has switched itself off reports the fault until its mode changes. A fault is missed only if the mode
/// changes before the next sample.
///
/// Currents are used for slow quantities: the heat of a winding, which changes in seconds, and alerts for a host. A
/// modelled current is computed at each tick. With two samples in the default control period, a measured current is no
/// older than a modelled current.
pub const SENSE_INTERVAL: Duration = Duration::from_millis(25);

/// Runs the task. Never returns.
pub async fn run<M: RawMutex, const N: usize>(
    mut sensors: impl BridgeSensors<N>,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let mut ticker = Ticker::every(SENSE_INTERVAL);
    loop {
        wires.sensed.signal(sensors.sample().await);
        health.check_in(Task::Bridges);
        ticker.next().await;
    }
}
