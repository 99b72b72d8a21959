//! Velocity from counts and their time stamps.
//!
//! The estimator divides counts by the time between the *edges* that delimit them, not by the
//! control period: at 23 counts/s and 50 ms that reads 23, where counts per period reads 20, 20, 40.
//! While no count comes, the estimate can be no more than one count in the time waited, so a
//! stopping motor's estimate falls as 1/t, and a motor at one count a second reads 1.
//!
//! **Lag:** the mean of the window, so half of it: 25 ms at a 50 ms control period (below 20 counts/s:
//! half the time between counts). The window is the control period, but at least 20 ms.
//!
//! **Error at constant speed:** one sampling interval of the counter (1 ms) in the window: 2 % at
//! 50 ms, and none once every sample sees a count.

use super::encoder::Reading;
use crate::units::{CountsPerSecond, Period};
use heapless::Deque;

/// Readings of a 20 ms window at the shortest period.
const CAPACITY: usize = 20;

/// Speed bits (1/256 count/s) of one count per microsecond.
const PER_MICROSECOND: i64 = 256_000_000;

/// Velocity of one motor.
#[derive(Clone, Debug)]
pub struct VelocityEstimator {
    /// Oldest first; holds at most `ticks`.
    history: Deque<Reading, CAPACITY>,
    ticks: usize,
    estimate: CountsPerSecond,
}

impl VelocityEstimator {
    /// For readings that come every `period`.
    pub fn new(period: Period) -> Self {
        let ticks = (CAPACITY as u32).div_ceil(period.as_millis()) as usize;
        Self { history: Deque::new(), ticks, estimate: CountsPerSecond::ZERO }
    }

    /// Takes this tick's reading.
    pub fn step(&mut self, new: Reading) -> CountsPerSecond {
        let Some(&old) = self.history.front() else {
            // Room for one is certain in an empty queue.
            let _ = self.history.push_back(new);
            return self.estimate;
        };
        let moved = i64::from(new.position.wrapping_sub(old.position));
        let counts = moved.abs();
        let window = new.at.since(old.at);
        // From the last edge before the window, unless that is so long ago that the motor was at
        // rest: several counts then began within the window.
        let at_rest = old.at.since(old.edge_at) > window;
        let from = if at_rest && counts > 1 { old.at } else { old.edge_at };

        let speed = if moved == 0 {
            i64::from(self.estimate.to_bits())
        } else {
            rate(moved, new.edge_at.since(from))
        };
        // Since the last edge less than one count has passed.
        let most = rate(counts + 1, new.at.since(from));
        self.estimate = CountsPerSecond::saturating_from_bits(speed.clamp(-most, most));

        while self.history.len() >= self.ticks {
            self.history.pop_front();
        }
        let _ = self.history.push_back(new);
        self.estimate
    }

    /// The latest estimate.
    pub const fn get(&self) -> CountsPerSecond {
        self.estimate
    }
}

/// `counts` in `micros` as speed bits. |counts| is below 2^33, so the product fits.
fn rate(counts: i64, micros: u64) -> i64 {
    let micros = i64::try_from(micros).unwrap_or(i64::MAX).max(1);
    counts * PER_MICROSECOND / micros
}
