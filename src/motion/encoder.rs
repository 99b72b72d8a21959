//! Encoder counts: 16-bit hardware counters unwrapped to positions, and the time of the last count.

use crate::units::Micros;

/// Half an hour in microseconds: as good as for ever, and times within it fit 32 bits.
pub const LONGEST_REST: u64 = 1_800_000_000;

/// What is known of an encoder at one instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reading {
    /// Counts since boot or reset, wrapping at 32 bits. Positive is CW.
    pub position: i32,
    /// When the count last changed, as seen by the sampling: late by at most one sampling interval. No
    /// further back than [`LONGEST_REST`].
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
                    edge_at: if moved != 0 {
                        now
                    } else if now.since(last.edge_at) > LONGEST_REST {
                        Micros::new(now.get() - LONGEST_REST)
                    } else {
                        last.edge_at
                    },
                    at: now,
                }
            }
        };
        self.last = Some((count, reading));
        reading
    }
}
