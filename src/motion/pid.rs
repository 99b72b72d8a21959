//! PID with feed-forward, in fixed point, with an integrator that does not wind up.
//!
//! ```
//! use motor_hub::motion::pid::{Pid, PidInput, Pidf, Value};
//! use motor_hub::units::{Coefficient, Period};
//!
//! // 2 control steps per count/s, and 3 more for every cycle of 50 ms: in Q16.16.
//! let [p, i] = [2, 3].map(|whole| Coefficient::from_bits(whole << 16));
//! let gains = Pidf { p, i, ..Pidf::default() };
//! let input = PidInput {
//!     error: Value::from_num(100),
//!     measured: Value::from_num(900),
//!     feed_forward: Value::from_num(1_000),
//!     limit: Value::from_num(32_767),
//! };
//! let mut velocity_loop = Pid::default();
//! assert_eq!(velocity_loop.step(&gains, Period::DEFAULT, input), 2 * 100 + 3 * 100);
//! assert_eq!(velocity_loop.step(&gains, Period::DEFAULT, input), 2 * 100 + 2 * 3 * 100);
//! ```

use crate::units::{Coefficient, Period};
use fixed::types::{I16F16, I24F8, I40F24};

/// What goes into a loop and comes out of it, in its own unit: +-8 388 607, in steps of 1/256.
pub type Value = I24F8;

/// A coefficient times a value, exact, and sums of such: +-2^39.
type Term = I40F24;

/// The cycle for which hosts choose I and D, in milliseconds: that of the hubs whose protocol this is. A loop of another
/// period does as much in the same time.
const CYCLE_MS: i64 = 50;

/// Coefficients of one loop, as hosts give them.
///
/// Velocity loop: steps per count/s of the error (P), of the error in each cycle of 50 ms (I), of its change from one
/// cycle to the next (D), of the set-point (F). With F a step is 1/32 767 of the battery's voltage, in every scheme and by
/// both duty rules; without F it is one of the control value. Position loop: counts/s per count, in the same way; F is not
/// used, its set-point has no rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pidf {
    /// Proportional.
    pub p: Coefficient,
    /// Integral, per cycle of 50 ms: 20 I a second, whatever the period.
    pub i: Coefficient,
    /// Derivative, in cycles of 50 ms: D / 20 in seconds; of the measurement, so a set-point step gives no kick.
    pub d: Coefficient,
    /// Feed-forward.
    pub f: Coefficient,
}

impl Pidf {
    /// What P makes of an error, and F of what it is for.
    pub(crate) fn share(&self, error: Value) -> Value {
        Value::saturating_from_num(product(self.p, error).saturating_add(product(self.f, error)))
    }
}

/// What a loop is given each tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PidInput {
    /// Set-point minus measurement.
    pub error: Value,
    /// Measurement; it may wrap, as positions do, so half of the range is the most that it may change
    /// in a tick.
    pub measured: Value,
    /// What F multiplies.
    pub feed_forward: Value,
    /// The output's largest magnitude; the sign does not matter.
    pub limit: Value,
}

/// Time constant of the derivative's filter, in milliseconds.
const DERIVATIVE_FILTER_MS: i64 = 20;

/// State of one loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pid {
    /// In the output's unit.
    integral: Term,
    last_measured: Option<Value>,
    /// Filtered rate of the measurement, per second.
    rate: Value,
}

impl Pid {
    /// One tick. The output is rounded down, and within `input.limit`.
    ///
    /// Anti-windup: the integrator moves only if the output does not saturate, or if it moves the
    /// output back into its range, and never beyond the range by itself. Nor does what is fed forward go beyond it.
    pub fn step(&mut self, gains: &Pidf, period: Period, input: PidInput) -> Value {
        let limit = Term::from(input.limit).abs();
        let last = self.last_measured.replace(input.measured);
        let derivative = if gains.d == Coefficient::ZERO {
            Term::ZERO
        } else {
            if let Some(last) = last {
                self.follow(input.measured.wrapping_sub(last), period);
            }
            product(gains.d, self.rate) / (1000 / CYCLE_MS)
        };
        let proportional = product(gains.p, input.error);
        let increment =
            product(gains.i, input.error).saturating_mul_int(period.as_millis().into()) / CYCLE_MS;
        let integral = self.integral.saturating_add(increment);
        let feed_forward = product(gains.f, input.feed_forward).clamp(-limit, limit);

        let wanted =
            proportional.saturating_add(integral).saturating_sub(derivative).saturating_add(feed_forward);
        let output = wanted.clamp(-limit, limit);
        let winds_up = output != wanted && wanted.is_negative() == increment.is_negative();
        if !winds_up {
            self.integral = integral.clamp(-limit, limit);
        }
        Value::saturating_from_num(output)
    }

    /// The rate's filter, of first order; what does not fit is far beyond any limit.
    fn follow(&mut self, change: Value, period: Period) {
        // At least 1 anyway, which spares the division a panic.
        let ms = i64::from(period.as_millis()).max(1);
        let rate = Value::saturating_from_num(Term::from(change) * 1000 / ms);
        let step = (Term::from(rate) - Term::from(self.rate)) * ms / (ms + DERIVATIVE_FILTER_MS);
        self.rate = self.rate.saturating_add(Value::saturating_from_num(step));
    }

    /// Forgets the past, as when a loop is switched on.
    pub const fn reset(&mut self) {
        *self = Self { integral: Term::ZERO, last_measured: None, rate: Value::ZERO };
    }

    /// Starts such that the output would be this if nothing were wrong with the measurement. Of the past
    /// nothing else is left. A loop that does not integrate has no way to unlearn it, and starts at nothing.
    pub fn preset(&mut self, gains: &Pidf, output: Value, measured: Value) {
        self.reset();
        if gains.i != Coefficient::ZERO {
            self.integral = Term::from(output).saturating_sub(product(gains.f, measured));
        }
    }
}

fn product(coefficient: Coefficient, value: Value) -> Term {
    I16F16::from_bits(coefficient.to_bits()).wide_mul(value)
}
