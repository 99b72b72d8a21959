//! Unwraps 16-bit hardware counters to positions, and notes the time of the last count.
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

/// The state of an encoder at one sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading {
    /// Position in counts from the first sample after the hub started, positive clockwise. The position wraps at 32
    /// bits.
    pub position: i32,
    /// Time of the first sample with the present count. The edge was at most one sampling interval earlier. Before
    /// the first count, this is the time of the first sample.
    pub edge_at: Micros,
    /// Time of the sample.
    pub at: Micros,
}

impl Reading {
    /// Time from the last edge to the sample, in µs.
    pub const fn since_edge_us(self) -> u64 {
        self.at.since(self.edge_at)
    }
}

/// Unwraps one 16-bit counter.
///
/// The counter must be sampled again before 32 768 counts have come. A sample each millisecond allows 32 million
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
                // The counter gives two distances, one in each direction. The shorter distance is the true one.
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
