//! PID regulation by coefficients of a host: the velocity loop, and the position loop above it.
//!
//! With feed-forward the velocity loop's output is a share of the battery's voltage, for which hosts choose F, so its
//! request is a voltage. Without feed-forward the output is a control value.

use super::{Context, Demand, Effort, Output, Reference};
use crate::motion::Pid;
use crate::motion::pid::{PidInput, Value};
use crate::settings::Coefficients;
use crate::units::{Coefficient, Control, CountsPerSecond, Period, Voltage};
use libm::{roundf, sqrtf};

/// Voltage of whose acceleration half is planned for braking, in V.
const BRAKING_VOLTS: f32 = 11.0;

/// How the velocity loop's integral begins at the next step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Start {
    /// The integral goes on.
    Running,
    /// The integral alone keeps the present current. The shares of P and D in the output come on top.
    #[default]
    Resume,
    /// The integral alone keeps a current of zero.
    ZeroCurrent,
    /// Integral and P together keep the present current: coefficients or scheme have changed while the bridge was closed.
    Continue,
}

/// State of both loops.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Loops {
    velocity: Pid,
    position: Pid,
    start: Start,
}

/// What a tick passes to both loops besides its [`Context`].
#[derive(Clone, Copy)]
pub(super) struct Inputs<'a> {
    /// Coefficients of both loops.
    pub(super) coefficients: &'a Coefficients,
    /// Position, in counts.
    pub(super) position: i32,
    /// Estimated speed.
    pub(super) velocity: CountsPerSecond,
    /// Acceleration per volt, in counts/s².
    pub(super) gain: f32,
    /// Voltage that keeps the present current.
    pub(super) steady: Voltage,
}

impl Loops {
    /// Keeps the present current at the next step, if the bridge is closed now.
    pub(super) fn keep_current(&mut self, closed: bool) {
        if closed && matches!(self.start, Start::Running | Start::Resume) {
            self.start = Start::Continue;
        }
    }

    /// The position loop forgets the past.
    pub(super) const fn restart_position(&mut self) {
        self.position.reset();
    }

    /// The motor keeps its current at the next step.
    pub(super) const fn resume(&mut self) {
        self.start = Start::Resume;
    }

    /// The motor starts with a current of zero at the next step.
    pub(super) const fn start_at_zero_current(&mut self) {
        self.start = Start::ZeroCurrent;
    }

    /// True if the velocity loop continues from its last step.
    pub(super) fn is_running(&self) -> bool {
        self.start == Start::Running
    }

    /// True if the velocity loop starts with a current of zero.
    pub(super) fn starts_at_zero_current(&self) -> bool {
        self.start == Start::ZeroCurrent
    }

    /// True if the velocity loop continues with other coefficients.
    pub(super) fn continues(&self) -> bool {
        self.start == Start::Continue
    }

    /// Computes the output for this tick.
    pub(super) fn step(&mut self, demand: Demand, inputs: &Inputs<'_>, context: &Context<'_>) -> Output {
        let target = match demand {
            Demand::Velocity(target) => {
                self.position.reset();
                target
            }
            Demand::Follow(reference) => self.follow(&reference, inputs, context.period),
            Demand::Position { target, speed_limit } => {
                self.approach(target, speed_limit, inputs, context.period)
            }
        };
        Output { effort: self.velocity(target, inputs, context), speed: target, hunts: false }
    }

    /// Computes the request for a target speed.
    fn velocity(&mut self, target: CountsPerSecond, inputs: &Inputs<'_>, context: &Context<'_>) -> Effort {
        let Inputs { coefficients, velocity, steady, .. } = *inputs;
        let gains = &coefficients.velocity;
        let most = f32::from(Control::MAX.get());
        let of_voltage = gains.f != Coefficient::ZERO;
        let [target, measured] = [target, velocity].map(|speed| Value::from_bits(speed.to_bits()));
        let error = target.saturating_sub(measured);
        if self.start != Start::Running {
            let output = Value::saturating_from_num(if of_voltage {
                most * steady.to_volts() / context.at.battery_volts()
            } else {
                f32::from(context.modulator.control(context.at, steady).get())
            });
            let output = if self.continues() { without(output, gains.share(error)) } else { output };
            self.velocity.preset(gains, output, measured);
            self.start = Start::Running;
        }
        let input =
            PidInput { error, measured, feed_forward: target, limit: Value::saturating_from_num(most) };
        let output = self.velocity.step(gains, context.period, input).to_num::<f32>();
        if of_voltage {
            Effort::Voltage(Voltage::from_volts(output / most * context.at.battery_volts()))
        } else {
            Effort::Control(Control::saturating((roundf(output) as i32).into()))
        }
    }

    /// The target speed for a moving reference.
    fn follow(&mut self, reference: &Reference, inputs: &Inputs<'_>, period: Period) -> CountsPerSecond {
        let distance = Value::saturating_from_num(reference.from(inputs.position));
        let closer = self.position_loop(distance, Value::MAX, inputs, period);
        let speed = i64::from(reference.next.to_bits()) + i64::from(closer.to_bits());
        CountsPerSecond::saturating_from_bits(speed)
    }

    /// The target speed towards a position, limited so that the motor can still brake.
    fn approach(
        &mut self,
        target: i32,
        speed_limit: CountsPerSecond,
        inputs: &Inputs<'_>,
        period: Period,
    ) -> CountsPerSecond {
        // The short way round the ring of 2^32 counts; the position loop saturates at 8 million counts.
        let distance = target.wrapping_sub(inputs.position);
        let stoppable = sqrtf(inputs.gain * BRAKING_VOLTS * distance.unsigned_abs() as f32);
        let limit = speed_limit.to_bits().unsigned_abs().min((256.0 * stoppable) as u32);
        let limit = Value::from_bits(limit.cast_signed());
        let speed = self.position_loop(Value::saturating_from_num(distance), limit, inputs, period);
        CountsPerSecond::from_bits(speed.to_bits())
    }

    /// One step of the position loop: counts to counts/s.
    fn position_loop(&mut self, error: Value, limit: Value, inputs: &Inputs<'_>, period: Period) -> Value {
        let measured = Value::wrapping_from_num(inputs.position);
        let input = PidInput { error, measured, feed_forward: Value::ZERO, limit };
        self.position.step(&inputs.coefficients.position, period, input)
    }
}

/// Subtracts the error's share from the output. The result is 0 if the share has the sign of the output and exceeds it.
fn without(output: Value, share: Value) -> Value {
    if output.is_negative() == share.is_negative() && share.unsigned_abs() > output.unsigned_abs() {
        Value::ZERO
    } else {
        output.saturating_sub(share)
    }
}
