//! A PID loop with feed-forward and anti-windup, in fixed point.
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

/// An input or the output of a loop, in the loop's unit: +-8 388 607, in steps of 1/256.
pub type Value = I24F8;

/// Cycle for which hosts choose I and D, in ms: the control period of REV's hubs. With another period I and D have
/// the same effect per time.
const CYCLE_MS: i64 = 50;

/// Coefficients of one loop, in the units of the protocol.
///
/// * Velocity loop: output steps per count/s, of the error (P), the error in each cycle of 50 ms (I), the error's
///   change per cycle (D) and the set-point (F). If F is 0, an output step is a step of the control value. If F is not
///   0, an output step is 1/32767 of the battery voltage, in every scheme and with both duty rules.
/// * Position loop: counts/s per count, of the error (P, I and D). F is not used, because the set-point has no rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pidf {
    /// Proportional coefficient.
    pub p: Coefficient,
    /// Integral coefficient per cycle of 50 ms. At every period this is 20 I per second.
    pub i: Coefficient,
    /// Derivative coefficient in cycles of 50 ms. At every period this is D / 20 in seconds. The coefficient acts on
    /// the measurement, so a step of the set-point gives no kick.
    pub d: Coefficient,
    /// Feed-forward coefficient.
    pub f: Coefficient,
}

impl Pidf {
    /// The sum of the proportional and the feed-forward term of an error.
    pub(crate) fn share(&self, error: Value) -> Value {
        Value::saturating_from_num(product(self.p, error).saturating_add(product(self.f, error)))
    }
}

/// The inputs of a loop at one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PidInput {
    /// Set-point minus measurement.
    pub error: Value,
    /// Measurement. The value may wrap, as positions do, if it changes by less than half of the range in a tick.
    pub measured: Value,
    /// Value by which the feed-forward coefficient is multiplied.
    pub feed_forward: Value,
    /// Largest magnitude of the output. The sign of the limit has no effect.
    pub limit: Value,
}

/// Time constant of the derivative filter, in ms.
const DERIVATIVE_FILTER_MS: i64 = 20;

/// The state of one loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pid {
    /// Integral, in the output's unit. A term has the exact product of a coefficient and a value: +-2^39.
    integral: I40F24,
    last_measured: Option<Value>,
    /// Filtered rate of the measurement, per second.
    rate: Value,
}

impl Pid {
    /// Executes a tick. Returns the output, rounded down and limited to `input.limit` in both directions.
    ///
    /// Anti-windup: while the output saturates, the integral changes only towards the range. Integral and feed-forward
    /// are each limited to the range.
    pub fn step(&mut self, gains: &Pidf, period: Period, input: PidInput) -> Value {
        let limit = I40F24::from(input.limit).abs();
        let last = self.last_measured.replace(input.measured);
        let derivative = if gains.d == Coefficient::ZERO {
            I40F24::ZERO
        } else {
            if let Some(last) = last {
                self.update_rate(input.measured.wrapping_sub(last), period);
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

    /// Updates the filtered rate by a change of the measurement since the last tick. The filter is of first order. A
    /// saturated rate is far beyond any limit.
    fn update_rate(&mut self, change: Value, period: Period) {
        // A period is at least 1 ms. The compiler then leaves out the check for a division by 0.
        let ms = i64::from(period.as_millis()).max(1);
        let rate = Value::saturating_from_num(I40F24::from(change) * 1000 / ms);
        let step = (I40F24::from(rate) - I40F24::from(self.rate)) * ms / (ms + DERIVATIVE_FILTER_MS);
        self.rate = self.rate.saturating_add(Value::saturating_from_num(step));
    }

    /// Takes the integral of `before`, the loop before its last tick, if the integral has changed in this direction
    /// since then. Anti-windup for an output that is limited behind the loop.
    pub(crate) fn undo_integral(&mut self, before: &Self, upwards: bool) {
        if (self.integral > before.integral) == upwards {
            self.integral = before.integral;
        }
    }

    /// Resets the loop to its initial state.
    pub const fn reset(&mut self) {
        *self = Self { integral: I40F24::ZERO, last_measured: None, rate: Value::ZERO };
    }

    /// Resets the loop for a bumpless start of a loop with I: at an error of 0 the next output is `output`.
    ///
    /// The feed-forward of `measured` is subtracted from the integral. A loop without I starts with an integral of 0,
    /// because the loop could never change another integral.
    pub fn preset(&mut self, gains: &Pidf, output: Value, measured: Value) {
        self.reset();
        if gains.i != Coefficient::ZERO {
            self.integral = I40F24::from(output).saturating_sub(product(gains.f, measured));
        }
    }
}

/// The exact product of a coefficient and a value.
fn product(coefficient: Coefficient, value: Value) -> I40F24 {
    I16F16::from_bits(coefficient.to_bits()).wide_mul(value)
}
