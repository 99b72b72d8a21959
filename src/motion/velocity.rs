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
//!
//! ```
//! use motor_hub::motion::{Tracker, VelocityEstimator};
//! use motor_hub::units::{Micros, Period};
//!
//! let mut encoder = Tracker::default();
//! let mut velocity = VelocityEstimator::new(Period::DEFAULT);
//! velocity.step(encoder.step(0, Micros::new(0)));
//! // A count after 40 ms, and none in the 10 ms since: 25 counts/s.
//! encoder.step(1, Micros::new(40_000));
//! assert_eq!(velocity.step(encoder.step(1, Micros::new(50_000))).round(), 25);
//! // And none in the 50 ms after that: 1 count in 60 ms is the most that it can be.
//! assert_eq!(velocity.step(encoder.step(1, Micros::new(100_000))).round(), 17);
//! ```

use super::encoder::Reading;
use crate::units::{CountsPerSecond, Micros, Period};
use heapless::Deque;

/// The shortest window.
const WINDOW_MS: u32 = 20;

/// Velocity of one motor.
#[derive(Clone, Debug)]
pub struct VelocityEstimator {
    /// Readings of the window that ends at the next one, the oldest first.
    history: Deque<Reading, { WINDOW_MS as usize }>,
    /// As many readings.
    ticks: usize,
    estimate: CountsPerSecond,
    /// The speed it started at, until the window is full.
    start: Option<CountsPerSecond>,
}

impl VelocityEstimator {
    /// For readings that come every `period`.
    pub const fn new(period: Period) -> Self {
        let ticks = WINDOW_MS.div_ceil(period.as_millis()) as usize;
        Self { history: Deque::new(), ticks, estimate: CountsPerSecond::ZERO, start: None }
    }

    /// Takes this tick's reading.
    pub fn step(&mut self, new: Reading) -> CountsPerSecond {
        if self.history.back().is_some_and(|last| last.at == new.at) {
            return self.estimate;
        }
        // The first reading is as old as all that came before it.
        let old = self.history.front().copied().unwrap_or(new);
        if self.history.len() >= self.ticks {
            self.history.pop_front();
        }
        let filled = self.history.len();
        // There is room: at one reading a millisecond or less, a window has no more.
        self.history.push_back(new).ok();

        let Some(estimate) = between(old, new, self.estimate) else { return self.estimate };
        self.estimate = CountsPerSecond::saturating_from_bits(match self.start {
            // The rest of the window was at that speed.
            Some(start) if filled + 1 < self.ticks => {
                let start = i64::from(start.to_bits());
                start + (estimate - start) * filled as i64 / self.ticks as i64
            }
            _ => {
                self.start = None;
                estimate
            }
        });
        self.estimate
    }

    /// Starts afresh, from a speed that is known otherwise.
    pub fn start_at(&mut self, speed: CountsPerSecond) {
        self.history.clear();
        self.estimate = speed;
        self.start = Some(speed);
    }

    /// The latest estimate.
    pub const fn get(&self) -> CountsPerSecond {
        self.estimate
    }
}

/// The mean speed from one reading to another, in steps of 1/256 count/s; `None` of one and the same. `before` is what was
/// estimated before.
pub(super) fn between(old: Reading, new: Reading, before: CountsPerSecond) -> Option<i64> {
    let moved = i64::from(new.position.wrapping_sub(old.position));
    let window = micros(old.at, new.at);
    if window == 0 {
        return None;
    }
    // From the last edge before the window, unless that is so long ago that the motor was at
    // rest: several counts then began within the window.
    let at_rest = micros(old.edge_at, old.at) > window;
    let from = if at_rest && moved.abs() > 1 { old.at } else { old.edge_at };
    let moving = micros(from, new.edge_at);
    let resting = micros(new.edge_at, new.at);

    let estimate = if moved == 0 { before.to_bits().into() } else { rate(moved, moving) };
    // Since the last edge less than one count has passed, which tells something only if that takes
    // longer than the counts before it.
    let slowing = moved == 0 || resting.saturating_mul(moved.abs()) > moving;
    let most = if slowing { rate(moved.abs() + 1, micros(from, new.at)) } else { i64::MAX };
    Some(estimate.clamp(-most, most))
}

/// Microseconds between two times.
const fn micros(from: Micros, to: Micros) -> i64 {
    // The sign bit is 292 000 years away.
    to.since(from).cast_signed()
}

/// What fits 32 bits.
const LONG: i64 = i32::MAX as i64;

/// `counts` (up to 2^31) in `micros`, in steps of 1/256 count/s, rounded towards 0.
fn rate(counts: i64, micros: i64) -> i64 {
    // In single precision, whose division is the shorter one by far; 24 bits are more than a count is good for. Half
    // an hour is as good as for ever.
    let [counts, micros] = [counts, micros.max(1)].map(|n| n.clamp(-LONG, LONG) as i32 as f32);
    i64::from((256e6 * counts / micros) as i32)
}
