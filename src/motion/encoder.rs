//! Encoder counts: 16-bit hardware counters unwrapped to positions, and the time of the last count.
//!
//! ```
//! use motor_hub::motion::Tracker;
//! use motor_hub::units::Micros;
//!
//! let mut tracker = Tracker::default();
//! assert_eq!(tracker.step(65_534, Micros::new(0)).position, 0);
//! assert_eq!(tracker.step(3, Micros::new(1_000)).position, 5);
//! let resting = tracker.step(3, Micros::new(2_000));
//! assert_eq!((resting.position, resting.edge_at), (5, Micros::new(1_000)));
//! ```

use crate::units::Micros;

/// What is known of an encoder at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading {
    /// Counts since boot or reset, wrapping at 32 bits. Positive is CW.
    pub position: i32,
    /// When the count last changed, as seen by the sampling: late by at most one sampling interval.
    pub edge_at: Micros,
    /// When the counter was sampled.
    pub at: Micros,
}

/// Follows one wrapping 16-bit counter.
///
/// The counter must be sampled before it moves 32 768 counts; at 1 ms that allows 32 million
/// counts/s.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tracker {
    last: Option<(u16, Reading)>,
}

impl Tracker {
    /// Takes a sample of the counter. The first sample defines position 0.
    pub fn step(&mut self, count: u16, now: Micros) -> Reading {
        let reading = match self.last {
            None => Reading { position: 0, edge_at: now, at: now },
            Some((last_count, last)) => {
                // The shortest way round.
                let moved = count.wrapping_sub(last_count).cast_signed();
                Reading {
                    position: last.position.wrapping_add(i32::from(moved)),
                    edge_at: if moved != 0 { now } else { last.edge_at },
                    at: now,
                }
            }
        };
        self.last = Some((count, reading));
        reading
    }
}
