//! PID with feed-forward, in fixed point, with an integrator that does not wind up.

use crate::units::{Coefficient, Period};

/// Coefficients of one loop.
///
/// Velocity loop: control counts per count/s (P), per count (I: the integral of a speed error),
/// per count/s^2 (D), per count/s of set-point (F). Position loop: counts/s per count (P), per
/// count s (I), per count/s (D); F is not used, its set-point has no rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pidf {
    /// Proportional.
    pub p: Coefficient,
    /// Integral, per second.
    pub i: Coefficient,
    /// Derivative, in seconds; of the measurement, so a set-point step gives no kick.
    pub d: Coefficient,
    /// Feed-forward.
    pub f: Coefficient,
}

/// A control period as the factors that the loops need.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// Seconds in steps of 2^-20: 1049 to 104 858.
    seconds: i64,
    /// Ticks per second in steps of 2^-16: 655 360 to 65 536 000.
    per_second: i64,
}

impl Tick {
    /// The factors of `period`.
    pub const fn new(period: Period) -> Self {
        let ms = period.as_millis() as i64;
        Self { seconds: ((ms << 20) + 500) / 1000, per_second: (1000 << 16) / ms }
    }
}

/// What a loop is given each tick, in steps of 1/256 of its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PidInput {
    /// Set-point minus measurement.
    pub error: i32,
    /// Measurement; it may wrap, as positions do, so half of the range is the most that it may change
    /// in a tick.
    pub measured: i32,
    /// What F multiplies.
    pub feed_forward: i32,
    /// The output's largest magnitude, in steps of 1/256, above 0.
    pub limit: i32,
    /// True if the last output had no effect, because the bridge was coasting: the integrator holds.
    pub hold: bool,
}

/// State of one loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pid {
    /// In steps of 2^-16 of the output's unit.
    integral: i64,
    last_measured: Option<i32>,
}

/// Rates of change are kept below this (32 control ranges) before they are multiplied by a
/// [`Tick`] factor of at most 26 bits.
const RATE_BOUND: i64 = 1 << 36;

impl Pid {
    /// One tick. The output is in steps of 1/256 of its unit, within `input.limit`.
    ///
    /// Anti-windup: the integrator moves only if the output does not saturate, or if it moves the
    /// output back into its range, and never beyond the range by itself.
    pub fn step(&mut self, gains: &Pidf, tick: Tick, input: PidInput) -> i32 {
        let limit = i64::from(input.limit) << 8;
        let p = product(gains.p, input.error);
        let f = product(gains.f, input.feed_forward);
        let d = match self.last_measured {
            Some(last) => {
                let change =
                    product(gains.d, input.measured.wrapping_sub(last)).clamp(-RATE_BOUND, RATE_BOUND);
                -((change * tick.per_second) >> 16)
            }
            None => 0,
        };
        self.last_measured = Some(input.measured);

        let increment = (product(gains.i, input.error).clamp(-RATE_BOUND, RATE_BOUND) * tick.seconds) >> 20;
        let wanted = p + f + d + self.integral + increment;
        let output = wanted.clamp(-limit, limit);
        let deeper = (wanted > limit && increment > 0) || (wanted < -limit && increment < 0);
        if !input.hold && !deeper {
            self.integral = (self.integral + increment).clamp(-limit, limit);
        }
        // Within the limit, which is 32 bits.
        (output >> 8) as i32
    }

    /// Forgets the past, as when a loop is switched on.
    pub const fn reset(&mut self) {
        *self = Self { integral: 0, last_measured: None };
    }
}

/// Coefficient (Q16) times value (Q8), in Q16: below 2^54.
fn product(coefficient: Coefficient, value: i32) -> i64 {
    (i64::from(coefficient.to_bits()) * i64::from(value)) >> 8
}
