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
use crate::units::{CountsPerSecond, Micros, Period};
use heapless::Deque;

/// Readings of a 20 ms window at the shortest period.
const CAPACITY: usize = 20;

/// Speed bits (1/256 count/s) of one count per microsecond.
const PER_MICROSECOND: u32 = 256_000_000;

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
        let moved = new.position.wrapping_sub(old.position);
        let counts = moved.unsigned_abs();
        let window = new.at.since(old.at);
        // From the last edge before the window, unless that is so long ago that the motor was at
        // rest: several counts then began within the window.
        let at_rest = old.at.since(old.edge_at) > window;
        let from = if at_rest && counts > 1 { old.at } else { old.edge_at };

        let (size, negative) = if counts == 0 {
            (self.estimate.to_bits().unsigned_abs().into(), self.estimate.to_bits() < 0)
        } else {
            (rate(counts, interval(new.edge_at, from)), moved < 0)
        };
        // Since the last edge less than one count has passed.
        let most = rate(counts.saturating_add(1), interval(new.at, from));
        let size = size.min(most).cast_signed();
        self.estimate = CountsPerSecond::saturating_from_bits(if negative { -size } else { size });

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

/// At least 1, at most 71 minutes.
fn interval(to: Micros, from: Micros) -> u32 {
    u32::try_from(to.since(from)).unwrap_or(u32::MAX).max(1)
}

/// `counts` in `micros` (at least 1) as speed bits, rounded down; below 2^60.
fn rate(counts: u32, micros: u32) -> u64 {
    // 32-bit divisions where they do: always, unless a million counts come in a window.
    let (whole, rest) = (PER_MICROSECOND / micros, PER_MICROSECOND % micros);
    let below_one = match counts.checked_mul(rest) {
        Some(product) => (product / micros).into(),
        None => u64::from(counts) * u64::from(rest) / u64::from(micros),
    };
    u64::from(counts) * u64::from(whole) + below_one
}
