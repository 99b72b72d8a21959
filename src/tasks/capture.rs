//! Encoder capture: samples all counters every millisecond and passes on positions and edge times. Of a
//! counter that does not answer the last reading is passed on, which soon is too old.

use super::{Health, Task, Wires, micros, whole_millisecond};
use crate::board::Encoders;
use crate::motion::{Reading, Tracker};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};

/// The sampling interval.
pub const CAPTURE_INTERVAL: Duration = Duration::from_millis(1);

/// Runs for ever.
pub async fn run<M: RawMutex, const N: usize>(
    mut encoders: impl Encoders<N>,
    wires: &Wires<M, N>,
    health: &Health,
) -> ! {
    let mut trackers = [Tracker::default(); N];
    let mut due = whole_millisecond(Instant::now());
    loop {
        let now = micros(Instant::now());
        let counts = encoders.counts();
        let read = |readings: &mut [Option<Reading>; N]| {
            for ((reading, tracker), count) in readings.iter_mut().zip(&mut trackers).zip(counts) {
                if let Some(count) = count {
                    *reading = Some(tracker.step(count, now));
                }
            }
        };
        wires.newest.lock(|newest| {
            // Nobody holds it over an await.
            if let Ok(mut newest) = newest.try_borrow_mut() {
                newest.sample(read);
            }
        });
        wires.news.signal(());
        health.check_in(Task::Capture);
        // What is late by more than an interval is left out. (The division takes some chips as long as all of this.)
        due += CAPTURE_INTERVAL;
        let now = Instant::now();
        if now > due {
            due = whole_millisecond(now);
        }
        Timer::at(due).await;
    }
}
