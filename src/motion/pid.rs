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
    seconds: i32,
    /// Ticks per second: 10 to 1000, in steps of 2^-8.
    per_second: i32,
}

impl Tick {
    /// The factors of `period`.
    pub const fn new(period: Period) -> Self {
        let ms = period.as_millis() as i32;
        Self { seconds: ((ms << 20) + 500) / 1000, per_second: (1000 << 8) / ms }
    }
}

/// What a loop is given each tick, in steps of 1/256 of its unit. Beyond +-2^30 steps (4 million), error
/// and feed-forward count as that.
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
    /// In steps of 1/256 of the output's unit.
    integral: i32,
    last_measured: Option<i32>,
}

impl Pid {
    /// One tick. The output is in steps of 1/256 of its unit, within `input.limit`.
    ///
    /// Anti-windup: the integrator moves only if the output does not saturate, or if it moves the
    /// output back into its range, and never beyond the range by itself.
    #[inline(always)]
    pub fn step(&mut self, gains: &Pidf, tick: Tick, input: PidInput) -> i32 {
        let limit = input.limit;
        let error = within::<30>(input.error);
        // In Q24: three products below 2^61.
        let mut sum = product(gains.p, error);
        if gains.f != Coefficient::ZERO {
            sum += product(gains.f, within::<30>(input.feed_forward));
        }
        if gains.d != Coefficient::ZERO {
            if let Some(last) = self.last_measured {
                // Per second; what does not fit is far beyond any limit.
                let change = input.measured.wrapping_sub(last);
                let rate = narrow((i64::from(change) * i64::from(tick.per_second)) >> 8);
                sum -= product(gains.d, within::<30>(rate));
            }
            self.last_measured = Some(input.measured);
        }
        let increment = if gains.i == Coefficient::ZERO {
            0
        } else {
            // The error (here up to 262 144 units) times the time, in steps of 2^-16.
            let area = ((i64::from(within::<26>(error)) * i64::from(tick.seconds)) >> 12) as i32;
            narrow((product(gains.i, area) + (1 << 23)) >> 24)
        };
        let wanted = narrow(sum >> 16).saturating_add(self.integral).saturating_add(increment);
        let output = wanted.clamp(-limit, limit);
        let deeper = output != wanted && (wanted ^ increment) >= 0;
        if !input.hold && !deeper {
            self.integral = self.integral.saturating_add(increment).clamp(-limit, limit);
        }
        output
    }

    /// Forgets the past, as when a loop is switched on.
    pub const fn reset(&mut self) {
        *self = Self { integral: 0, last_measured: None };
    }
}

/// Clamped to `BITS` bits and a sign: one instruction.
fn within<const BITS: u32>(value: i32) -> i32 {
    value.clamp(-1 << BITS, !(-1 << BITS))
}

/// Clamped to 32 bits.
fn narrow(value: i64) -> i32 {
    // Written so that what fits, which is nearly always, costs one comparison.
    let low = value as i32;
    if i64::from(low) == value {
        low
    } else if value < 0 {
        -i32::MAX
    } else {
        i32::MAX
    }
}

/// Coefficient (Q16) times a value.
fn product(coefficient: Coefficient, value: i32) -> i64 {
    i64::from(coefficient.to_bits()) * i64::from(value)
}
