//! Encoder capture: samples all counters every millisecond and passes on positions and edge times.

use super::{Health, Task, Wires, micros};
use crate::board::Encoders;
use crate::motion::Tracker;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Ticker};

/// The sampling interval.
pub const INTERVAL: Duration = Duration::from_millis(1);

/// Runs for ever.
pub async fn run<M: RawMutex, const N: usize>(
    mut encoders: impl Encoders<N>,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let mut trackers = [Tracker::default(); N];
    let mut ticker = Ticker::every(INTERVAL);
    loop {
        let now = micros(Instant::now());
        let mut counts = encoders.counts().into_iter();
        let readings = trackers.each_mut().map(|tracker| {
            // As many counts as trackers, by type.
            tracker.step(counts.next().unwrap_or_default(), now)
        });
        wires.readings.signal(readings);
        health.check_in(Task::Capture);
        ticker.next().await;
    }
}
