//! PID regulation by coefficients of a host: the velocity loop, and the position loop above it.
//!
//! With feed-forward the velocity loop's output is a share of the battery's voltage, for which hosts choose F, so its
//! request is a voltage. Without feed-forward the output is a control value.

use super::gain::GUESSED_TIME_CONSTANT_S;
use super::{Demand, Effort, Output, Reference, Stage};
use crate::braking::{Blend, BlendFraction, Scheme};
use crate::motion::pid::{PidInput, Value};
use crate::motion::{Pid, Pidf};
use crate::units::{Coefficient, Control, CountsPerSecond, EmfConstant, Period, Voltage};
use libm::{expf, expm1f, logf, roundf, sqrtf};

/// Bandwidth of the closed velocity loop by suggested coefficients, in 1/s.
const BANDWIDTH: f32 = 18.0;
/// Least share of a speed's error that suggested coefficients leave after a tick.
const QUICKEST_POLE: f32 = 0.6;
/// Least P of suggested coefficients, in full control at the speed whose back EMF is 12 V.
const LEAST_P: f32 = 0.3;
/// Battery voltage for which coefficients are suggested, in V.
const NOMINAL_VOLTS: f32 = 12.0;
/// Cycles of 50 ms by which hosts give I.
const CYCLES_PER_SECOND: f32 = 20.0;
/// How many times slower than the velocity loop the suggested position loop is: the motor may be much heavier than a
/// bare one.
const POSITION_SLOWER: f32 = 6.0;
/// Voltage of whose acceleration half is planned for braking, in V.
const BRAKING_VOLTS: f32 = 11.0;

/// Coefficients of both loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Coefficients {
    /// Coefficients of the velocity loop.
    pub velocity: Pidf,
    /// Coefficients of the position loop above the velocity loop.
    pub position: Pidf,
}

impl Coefficients {
    /// Suggests coefficients for an unknown motor, taken for a bare gear motor at a battery of 12 V. Hosts read them
    /// from a motor that has no coefficients.
    ///
    /// From one tick to the next a bare gear motor keeps `a = exp(-T / 0.14 s)` of its speed. Both poles are placed at
    /// `z = exp(-18 T)`, or 0.6. With `f` control steps per count/s, which is full control at the speed
    /// whose back EMF is 12 V:
    ///
    /// ```text
    /// P = f (a - z^2) / (1 - a)    I = f (1 - z)^2 / ((1 - a) T)
    /// ```
    ///
    /// Where a control value is a current, the back EMF does not damp the motor, and P grows by f to compensate. In
    /// Schemes C and D the control range spans less current, so P and I grow by up to 60 %. A fixed blend lies
    /// between B and C.
    pub fn guessed(emf: EmfConstant, scheme: Scheme, period: Period) -> Self {
        let f = emf.to_volts() * f32::from(Control::MAX.get()) / NOMINAL_VOLTS;
        let seconds = period.to_seconds();
        let lost = -expm1f(-seconds / GUESSED_TIME_CONSTANT_S);
        let kept = 1.0 - lost;
        let pole = expf(-BANDWIDTH * seconds).max(QUICKEST_POLE);
        let bandwidth = -logf(pole) / seconds;
        let p = ((kept - pole * pole) / lost).max(LEAST_P);
        let i = (1.0 - pole) * (1.0 - pole) / (lost * seconds);
        // `share` is how far the scheme is from B to C.
        let narrow = |share: f32| {
            let more = 1.0 + 0.6 * share;
            ((p + 1.0) * more, i * more)
        };
        let (p, i) = match scheme {
            Scheme::ForwardReverse | Scheme::A => (p, i),
            Scheme::B => narrow(0.0),
            Scheme::C | Scheme::D(Blend::Automatic) => narrow(1.0),
            Scheme::D(Blend::Fixed(blend)) => {
                narrow(blend.to_bits() as f32 / BlendFraction::ONE.to_bits() as f32)
            }
        };
        let pi = |p: f32, i: f32| Pidf {
            p: coefficient(p),
            i: coefficient(i / CYCLES_PER_SECOND),
            ..Pidf::default()
        };
        Self { velocity: pi(p * f, i * f), position: pi(bandwidth / POSITION_SLOWER, 0.0) }
    }
}

/// Rounds to the nearest step of 2^-16; saturates at the ends of the range.
fn coefficient(value: f32) -> Coefficient {
    Coefficient::from_bits(roundf(65_536.0 * value) as i32)
}

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

/// Inputs of both loops at a tick besides the motion.
#[derive(Clone, Copy)]
pub(super) struct Context<'a> {
    /// Coefficients of both loops.
    pub(super) coefficients: &'a Coefficients,
    /// Control period.
    pub(super) period: Period,
    /// Acceleration per volt, in counts/s².
    pub(super) gain: f32,
    /// Voltage that keeps the present current.
    pub(super) steady: Voltage,
    /// Bridge and supply at the tick.
    pub(super) stage: &'a Stage<'a>,
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

    /// Computes the output for this tick, at this position in counts and this speed.
    pub(super) fn step(
        &mut self,
        demand: Demand,
        position: i32,
        speed: CountsPerSecond,
        context: &Context<'_>,
    ) -> Output {
        let target = match demand {
            Demand::Velocity(target) => {
                self.position.reset();
                target
            }
            Demand::Follow(reference) => self.follow(&reference, position, context),
            Demand::Position { target, speed_limit } => self.approach(target, position, speed_limit, context),
        };
        Output { effort: self.velocity(target, speed, context), speed: target }
    }

    /// Computes the request for a target speed.
    fn velocity(
        &mut self,
        target: CountsPerSecond,
        measured: CountsPerSecond,
        context: &Context<'_>,
    ) -> Effort {
        let Context { coefficients, period, steady, stage, .. } = *context;
        let gains = &coefficients.velocity;
        let most = f32::from(Control::MAX.get());
        let of_voltage = gains.f != Coefficient::ZERO;
        let [target, measured] = [target, measured].map(|speed| Value::from_bits(speed.to_bits()));
        let error = target.saturating_sub(measured);
        if self.start != Start::Running {
            let output = Value::saturating_from_num(if of_voltage {
                most * steady.to_volts() / stage.at.battery_volts()
            } else {
                f32::from(stage.modulator.control(stage.at, steady).get())
            });
            let output = if self.continues() { without(output, gains.share(error)) } else { output };
            self.velocity.preset(gains, output, measured);
            self.start = Start::Running;
        }
        let input =
            PidInput { error, measured, feed_forward: target, limit: Value::saturating_from_num(most) };
        let output = self.velocity.step(gains, period, input).to_num::<f32>();
        if of_voltage {
            Effort::Voltage(Voltage::from_volts(output / most * stage.at.battery_volts()))
        } else {
            Effort::Control(Control::saturating((roundf(output) as i32).into()))
        }
    }

    /// The target speed for a moving reference.
    fn follow(&mut self, reference: &Reference, position: i32, context: &Context<'_>) -> CountsPerSecond {
        let distance = Value::saturating_from_num(reference.from(position));
        let closer = self.position_loop(distance, position, Value::MAX, context);
        let speed = i64::from(reference.next.to_bits()) + i64::from(closer.to_bits());
        CountsPerSecond::saturating_from_bits(speed)
    }

    /// The target speed towards a position, limited so that the motor can still brake.
    fn approach(
        &mut self,
        target: i32,
        position: i32,
        speed_limit: CountsPerSecond,
        context: &Context<'_>,
    ) -> CountsPerSecond {
        // The short way round the ring of 2^32 counts; the position loop saturates at 8 million counts.
        let distance = target.wrapping_sub(position);
        let stoppable = sqrtf(context.gain * BRAKING_VOLTS * distance.unsigned_abs() as f32);
        let limit = speed_limit.to_bits().unsigned_abs().min((256.0 * stoppable) as u32);
        let limit = Value::from_bits(limit.cast_signed());
        let speed = self.position_loop(Value::saturating_from_num(distance), position, limit, context);
        CountsPerSecond::from_bits(speed.to_bits())
    }

    /// One step of the position loop: counts to counts/s.
    fn position_loop(&mut self, error: Value, position: i32, limit: Value, context: &Context<'_>) -> Value {
        let measured = Value::wrapping_from_num(position);
        let input = PidInput { error, measured, feed_forward: Value::ZERO, limit };
        self.position.step(&context.coefficients.position, context.period, input)
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
