//! The velocity loop, and the position loop above it: proportional, integral and derivative action.
//!
//! With feed-forward the velocity loop's output is a share of the battery's voltage, for which hosts choose F; that becomes
//! the control value that makes it in the scheme and by the duty rule in force. Without, it is the control value itself.

use super::{Config, Demand, Reference, Request, Stage};
use crate::braking::{Blend, BlendFraction, Scheme};
use crate::motion::pid::{PidInput, Value};
use crate::motion::{Pid, Pidf};
use crate::units::{Coefficient, Control, CountsPerSecond, EmfConstant, Period, Voltage};
use libm::{expf, expm1f, logf, roundf, sqrtf};

/// The mechanical time constant of a motor of which nothing is known, in seconds: about that of a bare gear
/// motor.
pub(super) const GUESSED_TIME_CONSTANT: f32 = 0.14;
/// Of the closed loop, 1/s,
const BANDWIDTH: f32 = 18.0;
/// and what is left of an error after a tick, at least.
const QUICKEST_POLE: f32 = 0.6;
/// P at least, in full control at the speed whose back EMF is 12 V.
const LEAST_P: f32 = 0.3;
/// The voltage for which coefficients are.
const NOMINAL_VOLTS: f32 = 12.0;
/// Cycles by which an I is given.
const CYCLES_PER_SECOND: f32 = 20.0;
/// An acceleration per volt that was learned is put in force if it is so much more or less than that before.
const NEWS: f32 = 1.05;
/// Of its acceleration at this voltage a motor is trusted to brake with half.
const BRAKING_VOLTS: f32 = 11.0;

/// Coefficients of both loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Coefficients {
    /// Of regulated velocity.
    pub velocity: Pidf,
    /// Of the position loop above it.
    pub position: Pidf,
}

impl Coefficients {
    /// Coefficients for a motor of which only the back EMF is known, at a battery of 12 V: those that the hub
    /// itself begins with.
    pub fn guessed(emf: EmfConstant, scheme: Scheme, period: Period) -> Self {
        Self::for_time_constant(GUESSED_TIME_CONSTANT, Certainty::Guess, emf, scheme, period)
    }

    /// The same for a motor of this mechanical time constant in seconds.
    ///
    /// From one tick to the next the motor keeps `a = exp(-T / tau)` of its speed. Both poles are put at
    /// `z = exp(-18 T)`, or 0.6. With `f` control steps per count/s, which is full control at the speed
    /// whose back EMF is 12 V:
    ///
    /// ```text
    /// P = f (a - z^2) / (1 - a)    I = f (1 - z)^2 / ((1 - a) T)
    /// ```
    ///
    /// Where a control value is a current, the back EMF does not damp the motor: P makes up for it by another f.
    /// In C and D, whose range is less current, both grow by as much. A fixed blend lies between B and C.
    pub(super) fn for_time_constant(
        tau: f32,
        certainty: Certainty,
        emf: EmfConstant,
        scheme: Scheme,
        period: Period,
    ) -> Self {
        let f = emf.to_volts() * f32::from(Control::MAX.get()) / NOMINAL_VOLTS;
        let seconds = period.to_seconds();
        let lost = -expm1f(-seconds / tau);
        let kept = 1.0 - lost;
        let pole = expf(-BANDWIDTH * seconds).max(QUICKEST_POLE);
        let bandwidth = -logf(pole) / seconds;
        let p = ((kept - pole * pole) / lost).max(LEAST_P);
        let i = (1.0 - pole) * (1.0 - pole) / (lost * seconds);
        // Of a range with less current.
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
        // A motor that is much heavier than guessed swings by the velocity loop alone.
        let slower = match certainty {
            Certainty::Guess => 6.0,
            Certainty::Known => 3.0,
        };
        Self { velocity: pi(p * f, i * f), position: pi(bandwidth / slower, 0.0) }
    }
}

/// To the nearest step of 2^-16; what is too large is the end of the range.
fn coefficient(value: f32) -> Coefficient {
    Coefficient::from_bits(roundf(65_536.0 * value) as i32)
}

/// How well a motor is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Certainty {
    /// Not at all.
    Guess,
    /// From what was told or learned.
    Known,
}

/// What a volt does to a motor.
#[derive(Clone, Copy, Debug)]
pub(super) struct Knowledge {
    /// Acceleration per volt, counts/s².
    pub(super) gain: f32,
    pub(super) certainty: Certainty,
}

/// Both loops of one motor.
#[derive(Clone, Debug)]
pub(super) struct Loops {
    period: Period,
    coefficients: Coefficients,
    /// The coefficients are for a battery of 12 V, not a host's.
    guessed: bool,
    knowledge: Knowledge,
    velocity: Pid,
    position: Pid,
    start: Start,
}

/// How the velocity loop's integral begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Start {
    /// It runs on.
    Running,
    /// At what keeps the current as it is, to which the error's share comes.
    Resume,
    /// The same, without a current.
    Afresh,
    /// Such that the error's share is part of what flows.
    Continue,
}

impl Loops {
    /// For a motor that a volt accelerates by so many counts/s².
    pub(super) fn new(config: &Config, period: Period, knowledge: Knowledge) -> Self {
        let Knowledge { gain, certainty } = knowledge;
        // Of the motor's constants b kappa is 1 / tau.
        let tau = 1.0 / (gain * config.emf.to_volts());
        let own = || Coefficients::for_time_constant(tau, certainty, config.emf, config.scheme, period);
        Self {
            period,
            coefficients: config.coefficients.unwrap_or_else(own),
            knowledge,
            guessed: config.coefficients.is_none(),
            velocity: Pid::default(),
            position: Pid::default(),
            start: Start::Resume,
        }
    }

    pub(super) fn configure(&mut self, config: &Config, period: Period, knowledge: Knowledge) {
        let start = if self.start == Start::Running { Start::Continue } else { self.start };
        self.learn(config, period, knowledge);
        self.start = start;
    }

    /// Whether that is more than was known, or something else.
    pub(super) fn is_news(&self, knowledge: Knowledge) -> bool {
        let ratio = knowledge.gain / self.knowledge.gain;
        !(1.0 / NEWS..NEWS).contains(&ratio) || knowledge.certainty != self.knowledge.certainty
    }

    /// More is known of the motor than before.
    pub(super) fn learn(&mut self, config: &Config, period: Period, knowledge: Knowledge) {
        let Self { velocity, position, start, .. } = *self;
        *self = Self { velocity, position, start, ..Self::new(config, period, knowledge) };
    }

    /// The position loop forgets the past.
    pub(super) const fn restart_position(&mut self) {
        self.position.reset();
    }

    /// From the next step on the motor goes on as it is.
    pub(super) const fn resume(&mut self) {
        self.start = Start::Resume;
    }

    /// From the next step on nothing is left of the effort that there was.
    pub(super) const fn start_afresh(&mut self) {
        self.start = Start::Afresh;
    }

    /// The velocity loop runs on from its last step.
    pub(super) fn is_running(&self) -> bool {
        self.start == Start::Running
    }

    /// Nothing is to be left of the effort that there was.
    pub(super) fn starts_afresh(&self) -> bool {
        self.start == Start::Afresh
    }

    /// `steady` is the voltage that leaves the current as it is.
    pub(super) fn step(
        &mut self,
        demand: Demand,
        position: i32,
        velocity: CountsPerSecond,
        steady: Voltage,
        stage: &Stage<'_>,
    ) -> Request {
        let target = match demand {
            Demand::Velocity(target) => {
                self.position.reset();
                target
            }
            Demand::Follow(reference) => self.follow(&reference, position),
            Demand::Position { target, speed_limit } => self.approach(target, position, speed_limit),
        };
        Request { control: self.velocity(target, velocity, steady, stage), speed: target }
    }

    /// The control value for a velocity.
    fn velocity(
        &mut self,
        target: CountsPerSecond,
        measured: CountsPerSecond,
        steady: Voltage,
        stage: &Stage<'_>,
    ) -> Control {
        let gains = &self.coefficients.velocity;
        let most = f32::from(Control::MAX.get());
        let of_voltage = gains.f != Coefficient::ZERO;
        // A host's coefficients are of control; guessed ones are of volts.
        let scale = if self.guessed { NOMINAL_VOLTS / stage.battery } else { 1.0 };
        let [target, measured] = [target, measured].map(|speed| Value::from_bits(speed.to_bits()));
        let error = target.saturating_sub(measured);
        let steady = || {
            Value::saturating_from_num(if of_voltage {
                most * steady.to_volts() / stage.battery
            } else {
                f32::from(stage.placer.control(stage.at, steady).get()) / scale
            })
        };
        match self.start {
            Start::Running => {}
            Start::Resume | Start::Afresh => self.velocity.preset(gains, steady(), measured),
            Start::Continue => self.velocity.preset(gains, without(steady(), gains.share(error)), measured),
        }
        self.start = Start::Running;
        let input = PidInput {
            error,
            measured,
            feed_forward: target,
            limit: Value::saturating_from_num(most / scale),
        };
        let output = self.velocity.step(gains, self.period, input).to_num::<f32>();
        if of_voltage {
            stage.placer.control(stage.at, Voltage::from_volts(output / most * stage.battery))
        } else {
            Control::saturating((roundf(scale * output) as i32).into())
        }
    }

    /// The velocity at which to keep up with a place that moves.
    fn follow(&mut self, reference: &Reference, position: i32) -> CountsPerSecond {
        let distance = Value::saturating_from_num(reference.from(position));
        let input = PidInput {
            error: distance,
            measured: Value::wrapping_from_num(position),
            feed_forward: Value::ZERO,
            limit: Value::MAX,
        };
        let closer = self.position.step(&self.coefficients.position, self.period, input);
        let speed = i64::from(reference.next.to_bits()) + i64::from(closer.to_bits());
        CountsPerSecond::saturating_from_bits(speed)
    }

    /// The velocity at which to go to a position now: no more than can be braked from.
    fn approach(&mut self, target: i32, position: i32, speed_limit: CountsPerSecond) -> CountsPerSecond {
        let distance = target.wrapping_sub(position);
        let stoppable = sqrtf(self.knowledge.gain * BRAKING_VOLTS * distance.unsigned_abs() as f32);
        let limit = speed_limit.to_bits().unsigned_abs().min((256.0 * stoppable) as u32);
        let input = PidInput {
            // The short way round; 8 million counts are as good as more.
            error: Value::saturating_from_num(distance),
            measured: Value::wrapping_from_num(position),
            feed_forward: Value::ZERO,
            limit: Value::from_bits(limit.cast_signed()),
        };
        let speed = self.position.step(&self.coefficients.position, self.period, input);
        CountsPerSecond::from_bits(speed.to_bits())
    }
}

/// The output without the error's share, if that is part of it and not more than it.
fn without(output: Value, share: Value) -> Value {
    if output.is_negative() == share.is_negative() && share.unsigned_abs() > output.unsigned_abs() {
        Value::ZERO
    } else {
        output.saturating_sub(share)
    }
}
