//! Samples all encoder counters every millisecond, and passes positions and times of edges to control.
//!
//! If a counter cannot be read, the last reading of the counter stays. If a reading is older than 20 ms, control treats
//! the motor as a motor without encoder.

use super::{Health, Task, Wires, micros, whole_millisecond};
use crate::board::Encoders;
use crate::motion::Tracker;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};

/// Sampling interval.
pub const CAPTURE_INTERVAL: Duration = Duration::from_millis(1);

/// Runs the task. Never returns.
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
        wires.update_newest(|newest| {
            for ((reading, tracker), count) in newest.readings.iter_mut().zip(&mut trackers).zip(counts) {
                if let Some(count) = count {
                    *reading = Some(tracker.step(count, now));
                }
            }
        });
        wires.control_wake.signal(());
        health.check_in(Task::Capture);
        // If the next sample is overdue already, samples are skipped up to the next whole millisecond.
        due += CAPTURE_INTERVAL;
        let now = Instant::now();
        if now > due {
            due = whole_millisecond(now);
        }
        Timer::at(due).await;
    }
}
