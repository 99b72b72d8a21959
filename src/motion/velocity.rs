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

/// Readings of a 20 ms window at the shortest period.
const CAPACITY: usize = 20;

/// Speed bits (1/256 count/s) of one count per microsecond.
const PER_MICROSECOND: u32 = 256_000_000;

/// A reading with its times in 32 bits, which wrap after 71 minutes: longer than any interval between
/// them.
#[derive(Clone, Copy, Debug)]
struct Sample {
    position: i32,
    edge_at: u32,
    at: u32,
}

impl Sample {
    const fn new(reading: Reading) -> Self {
        const fn wrapped(time: Micros) -> u32 {
            time.get() as u32
        }
        Self { position: reading.position, edge_at: wrapped(reading.edge_at), at: wrapped(reading.at) }
    }
}

/// Velocity of one motor.
#[derive(Clone, Debug)]
pub struct VelocityEstimator {
    /// The first `ticks` of these, the oldest at `next`; `None` before the first reading.
    history: Option<[Sample; CAPACITY]>,
    ticks: u8,
    next: u8,
    estimate: CountsPerSecond,
}

impl VelocityEstimator {
    /// For readings that come every `period`.
    pub const fn new(period: Period) -> Self {
        let ticks = (CAPACITY as u32).div_ceil(period.as_millis()) as u8;
        Self { history: None, ticks, next: 0, estimate: CountsPerSecond::ZERO }
    }

    /// Takes this tick's reading.
    pub fn step(&mut self, reading: Reading) -> CountsPerSecond {
        let new = Sample::new(reading);
        // The first reading is as old as all that came before it.
        let history = self.history.get_or_insert([new; CAPACITY]);
        let Some(oldest) = history.get_mut(usize::from(self.next)) else {
            return self.estimate;
        };
        let old = core::mem::replace(oldest, new);
        self.next = if self.next + 1 < self.ticks { self.next + 1 } else { 0 };

        let moved = new.position.wrapping_sub(old.position);
        let counts = moved.unsigned_abs();
        let window = new.at.wrapping_sub(old.at);
        if window == 0 {
            return self.estimate;
        }
        // From the last edge before the window, unless that is so long ago that the motor was at
        // rest: several counts then began within the window.
        let at_rest = old.at.wrapping_sub(old.edge_at) > window;
        let from = if at_rest && counts > 1 { old.at } else { old.edge_at };
        let moving = new.edge_at.wrapping_sub(from);
        let resting = new.at.wrapping_sub(new.edge_at);
        let (bits, negative) = if counts == 0 {
            let bits = self.estimate.to_bits();
            (bits.unsigned_abs(), bits < 0)
        } else {
            (rate(counts, moving), moved < 0)
        };
        // Since the last edge less than one count has passed, which tells something only when it was
        // long ago.
        let bits = if counts == 0 || u64::from(counts) * u64::from(resting) > u64::from(moving) {
            bits.min(rate(counts.saturating_add(1), new.at.wrapping_sub(from)))
        } else {
            bits
        };
        let bits = bits.cast_signed();
        self.estimate = CountsPerSecond::from_bits(if negative { -bits } else { bits });
        self.estimate
    }

    /// The latest estimate.
    pub const fn get(&self) -> CountsPerSecond {
        self.estimate
    }
}

/// `counts` in `micros` as speed bits, rounded down; at most 2^31 - 1.
fn rate(counts: u32, micros: u32) -> u32 {
    const MOST: u32 = i32::MAX.unsigned_abs();
    let micros = micros.max(1);
    let (whole, rest) = (PER_MICROSECOND / micros, PER_MICROSECOND % micros);
    // 32 bits do, unless a million counts come in a window.
    match (counts.checked_mul(whole), counts.checked_mul(rest)) {
        (Some(whole), Some(rest)) => whole.saturating_add(rest / micros).min(MOST),
        _ => {
            let exact = u64::from(counts) * u64::from(PER_MICROSECOND) / u64::from(micros);
            u32::try_from(exact).unwrap_or(MOST).min(MOST)
        }
    }
}
