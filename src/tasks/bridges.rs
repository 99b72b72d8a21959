//! Samples the fault outputs and the currents of the bridges for control, on boards that have these signals.

use super::{Health, Task, Wires};
use crate::board::{BridgeFaults, CurrentSense};
use crate::bridge::BridgeFeedback;
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

/// Runs the task. Never returns. A board without current-sense lines passes `()` as `currents`.
pub async fn run<M: RawMutex, const N: usize>(
    mut faults: impl BridgeFaults<N>,
    mut currents: impl CurrentSense<N>,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let mut ticker = Ticker::every(SENSE_INTERVAL);
    loop {
        let mut sensed = currents.sample().await.map(|current| BridgeFeedback { current, fault: false });
        for (sensed, fault) in sensed.iter_mut().zip(faults.faults()) {
            sensed.fault = fault;
        }
        wires.sensed.signal(sensed);
        health.check_in(Task::Bridges);
        ticker.next().await;
    }
}
