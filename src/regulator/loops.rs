//! PID regulation with coefficients that a host has configured: the velocity loop, and the position loop above it.
//!
//! ```text
//! distance ─▶ position loop ─▶ target speed ─▶ velocity loop ─▶ voltage (with F) or control value (without F)
//!               ▲                                ▲
//!            position                    estimated speed
//! ```
//!
//! With feed-forward (F other than 0) the output of the velocity loop is a share of the battery voltage, because
//! hosts choose F for such an output. The request is then a voltage. Without feed-forward the output is a control
//! value.

use super::{Context, Demand, Effort, Output, Reference};
use crate::motion::Pid;
use crate::motion::pid::{PidInput, Value};
use crate::settings::Coefficients;
use crate::units::single::at_most;
use crate::units::{Coefficient, Control, CountsPerSecond, Period, Voltage};
use libm::{roundf, sqrtf};

/// Largest voltage with which the motor is assumed to brake before a target position, in V. The speed limit at each
/// distance follows from this voltage.
const BRAKING_VOLTS: f32 = 5.5;
/// Share of the largest voltage at standstill with which the motor is assumed to brake, if this share is lower than
/// [`BRAKING_VOLTS`].
const LIMITED_SHARE: f32 = 0.85;

/// How the velocity loop begins at the next step. Except for [`Running`](Self::Running), the integral is set so that
/// the output begins with a certain voltage, and D is 0 at this step. A loop without I has no integral to set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Start {
    /// The loop continues with its integral.
    Running,
    /// At an error of 0 the output gives the current that balances the load. With an error, P, I and F times the
    /// error add to this output.
    #[default]
    Resume,
    /// At an error of 0 the output gives a current of zero. With an error, P, I and F times the error add to it.
    ZeroCurrent,
    /// The output with P and F keeps the present voltage, because coefficients, scheme or constants have changed while
    /// the bridge was closed. If P and F alone exceed this voltage in its direction, the output exceeds this voltage.
    Continue,
}

/// State of both loops.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Loops {
    velocity: Pid,
    position: Pid,
    /// How the velocity loop begins.
    pub(super) start: Start,
    /// Voltage of the last request less the voltage within the motor's limits, in V; 0 within the limits.
    pub(super) excess_volts: f32,
}

/// Inputs of both loops at a tick, besides the [`Context`].
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a> {
    /// Coefficients of both loops.
    pub(super) coefficients: &'a Coefficients,
    /// Position, in counts.
    pub(super) position: i32,
    /// Estimated speed.
    pub(super) velocity: CountsPerSecond,
    /// Acceleration per volt, in counts/s² per V.
    pub(super) gain: f32,
    /// Voltage with which the velocity loop begins; `None` for [`Start::Running`].
    pub(super) start: Option<Voltage>,
}

impl Loops {
    /// Sets how the velocity loop begins at the next step, and resets the position loop. The excess of the last request
    /// is discarded.
    pub(super) const fn begin(&mut self, start: Start) {
        (self.start, self.excess_volts) = (start, 0.0);
        self.position.reset();
    }

    /// Computes the output for this tick.
    pub(super) fn step(&mut self, demand: Demand, inputs: &Inputs<'_>, context: &Context<'_>) -> Output {
        let target = match demand {
            Demand::Velocity(target) => {
                self.position.reset();
                target
            }
            Demand::Follow(reference) => self.follow(&reference, inputs, context.period),
            Demand::Position { target, speed_limit } => self.approach(target, speed_limit, inputs, context),
        };
        Output { effort: self.velocity(target, inputs, context), speed: target, hunts: false }
    }

    /// Steps the velocity loop for a target speed. Returns the request.
    fn velocity(&mut self, target: CountsPerSecond, inputs: &Inputs<'_>, context: &Context<'_>) -> Effort {
        let Inputs { coefficients, velocity, start, .. } = *inputs;
        let gains = &coefficients.velocity;
        let most = f32::from(Control::MAX.get());
        let of_voltage = gains.f != Coefficient::ZERO;
        let [target, measured] = [target, velocity].map(|speed| Value::from_bits(speed.to_bits()));
        let error = target.saturating_sub(measured);
        if let Some(start) = start {
            let output = Value::saturating_from_num(if of_voltage {
                most * start.to_volts() / context.at.battery_volts()
            } else {
                f32::from(context.modulator.control(context.at, start).get())
            });
            let continues = self.start == Start::Continue;
            let output = if continues { without(output, gains.share(error)) } else { output };
            self.velocity.preset(gains, output, measured);
            self.start = Start::Running;
        }
        let input =
            PidInput { error, measured, feed_forward: target, limit: Value::saturating_from_num(most) };
        let before = self.velocity;
        let output = self.velocity.step(gains, context.period, input).to_num::<f32>();
        if self.excess_volts != 0.0 {
            self.velocity.undo_integral(&before, self.excess_volts > 0.0);
        }
        if of_voltage {
            Effort::Voltage(Voltage::from_volts(output / most * context.at.battery_volts()))
        } else {
            Effort::Control(Control::saturating((roundf(output) as i32).into()))
        }
    }

    /// Steps the position loop for a moving reference. Returns the target speed. Its difference from the speed of the
    /// reference is at most the speed limit. The limit does not shrink with the distance as in
    /// [`approach`](Self::approach), so a lagging motor catches up.
    fn follow(&mut self, reference: &Reference, inputs: &Inputs<'_>, period: Period) -> CountsPerSecond {
        let distance = Value::saturating_from_num(reference.from(inputs.position));
        let limit = Value::from_bits(reference.speed_limit.to_bits());
        let closer = self.position_loop(distance, limit, inputs, period);
        let speed = i64::from(reference.next.to_bits()) + i64::from(closer.to_bits());
        CountsPerSecond::saturating_from_bits(speed)
    }

    /// Steps the position loop for a target position. Returns the target speed, limited so that the motor can still
    /// brake.
    fn approach(
        &mut self,
        target: i32,
        speed_limit: CountsPerSecond,
        inputs: &Inputs<'_>,
        context: &Context<'_>,
    ) -> CountsPerSecond {
        let period = context.period;
        let braking_volts = at_most(LIMITED_SHARE * context.standstill_volts, BRAKING_VOLTS);
        // The short way round the ring of 2^32 counts; the position loop saturates at 8 million counts.
        let distance = target.wrapping_sub(inputs.position);
        let stoppable = sqrtf(2.0 * inputs.gain * braking_volts * distance.unsigned_abs() as f32);
        let limit = speed_limit.to_bits().unsigned_abs().min((256.0 * stoppable) as u32);
        let limit = Value::from_bits(limit.cast_signed());
        let speed = self.position_loop(Value::saturating_from_num(distance), limit, inputs, period);
        CountsPerSecond::from_bits(speed.to_bits())
    }

    /// Steps the position loop, from counts to counts/s.
    fn position_loop(&mut self, error: Value, limit: Value, inputs: &Inputs<'_>, period: Period) -> Value {
        let measured = Value::wrapping_from_num(inputs.position);
        let input = PidInput { error, measured, feed_forward: Value::ZERO, limit };
        self.position.step(&inputs.coefficients.position, period, input)
    }
}

/// Subtracts the share of P and F from an output. The result is 0 if the share has the sign of the output and a
/// larger magnitude.
fn without(output: Value, share: Value) -> Value {
    if output.is_negative() == share.is_negative() && share.unsigned_abs() > output.unsigned_abs() {
        Value::ZERO
    } else {
        output.saturating_sub(share)
    }
}
