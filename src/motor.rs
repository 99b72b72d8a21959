//! One motor: its settings, its set-point, its state, and one step of control.

use crate::braking::{self, DutyRule, LinearCurrent, OperatingPoint, Placement, Regime, Scheme};
use crate::bridge::Drive;
use crate::motion::guard::{Evidence, Finding};
use crate::motion::pid::PidInput;
use crate::motion::{EncoderFault, Guard, Pid, Pidf, Reading, Tick, VelocityEstimator};
use crate::units::{Coefficient, Control, CountsPerSecond, EmfConstant, Micros, Millivolts, Period};

/// A reading older than this is none: the counters are sampled every millisecond.
pub const STALE_MICROS: u32 = 20_000;

/// Counts that still fit 32 bits in steps of 1/256.
const FAR: i32 = (1 << 23) - 1;

/// What a zero set-point means in constant power and in regulated velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ZeroPower {
    /// Constant power: full dynamic braking. Regulated velocity: held at standstill.
    #[default]
    Brake,
    /// The bridge is open.
    Float,
}

/// What does not change from tick to tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// Back EMF per encoder speed.
    pub emf: EmfConstant,
    /// Where S, T, Z and G lie.
    pub scheme: Scheme,
    /// How the duty is found within a regime.
    pub duty: DutyRule,
    /// What zero means.
    pub zero_power: ZeroPower,
    /// Coefficients of regulated velocity.
    pub velocity: Pidf,
    /// Coefficients of the position loop above it.
    pub position: Pidf,
}

impl Settings {
    /// [`for_scheme`](Self::for_scheme) A, the default.
    pub const fn new(emf: EmfConstant) -> Self {
        Self::for_scheme(emf, Scheme::A)
    }

    /// Settings that run a gear motor with this back-EMF constant: linear current of a typical
    /// winding, brake at zero, and coefficients in proportion to the motor's speed range.
    ///
    /// With `f` control counts per count/s, which is full control at the speed whose back EMF is 12 V:
    /// in Scheme A, where a control value is a voltage, P is 1.5 f. Where it is a current, the back EMF
    /// does not damp the motor, and P makes up for it by another f; in C and D, whose range is less current,
    /// it is 4 f, the best of those that `motor-hub compare` tries. I is 7.5 f per second, P's gain in A in
    /// 0.2 s, about the mechanical time constant of a loaded gear motor. Nothing is fed forward: what
    /// a set-point needs depends on the load, and the integral has it soon.
    pub const fn for_scheme(emf: EmfConstant, scheme: Scheme) -> Self {
        // From 6q20 to Q16.16; f is at most 87.4.
        let f = (emf.to_bits() as i64 * Control::MAX.get() as i64 / (12_000 << 4)) as i32;
        let p = match scheme {
            Scheme::ForwardReverse | Scheme::A => 3 * f / 2,
            Scheme::B => 5 * f / 2,
            Scheme::C | Scheme::D(_) => 4 * f,
        };
        Self {
            emf,
            scheme,
            duty: DutyRule::LinearCurrent(LinearCurrent::TYPICAL),
            zero_power: ZeroPower::Brake,
            velocity: Pidf {
                p: Coefficient::from_bits(p),
                i: Coefficient::from_bits(15 * f / 2),
                d: Coefficient::ZERO,
                f: Coefficient::ZERO,
            },
            position: Pidf {
                p: Coefficient::from_bits(5 << 16),
                i: Coefficient::ZERO,
                d: Coefficient::ZERO,
                f: Coefficient::ZERO,
            },
        }
    }
}

/// What a motor is asked to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Setpoint {
    /// Nothing: the bridge is open.
    #[default]
    Disabled,
    /// Open loop: 9/8 or 6/2 at this share of the control range, whatever the speed.
    ConstantPower(Control),
    /// Regulated velocity.
    Velocity(CountsPerSecond),
    /// Regulated position: a position loop above the velocity loop.
    Position {
        /// Where to go, in counts.
        target: i32,
        /// At target is reported within this many counts.
        tolerance: u16,
        /// Magnitude of the speed on the way; the sign does not matter.
        speed_limit: CountsPerSecond,
    },
}

impl Setpoint {
    /// The run mode, which decides which loops are active.
    const fn regulation(self) -> Regulation {
        match self {
            Self::Disabled | Self::ConstantPower(_) => Regulation::None,
            Self::Velocity(_) => Regulation::Velocity,
            Self::Position { .. } => Regulation::Position,
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Regulation {
    None,
    Velocity,
    Position,
}

/// What keeps a motor from doing what it is asked; each makes it coast.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Faults {
    /// No battery voltage is known: never measured, implausible, or too old.
    pub battery_unknown: bool,
    /// No encoder reading for 20 ms. Constant power runs on without one.
    pub encoder_stale: bool,
    /// The encoder of a regulated motor does not count, or counts the wrong way. Latched until the
    /// motor is disabled; constant power runs on.
    pub encoder: Option<EncoderFault>,
}

impl Faults {
    /// True if there is one.
    pub const fn any(self) -> bool {
        self.battery_unknown || self.encoder_stale || self.encoder.is_some()
    }
}

/// What a host would want to see of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Report {
    /// What it is asked to do.
    pub setpoint: Setpoint,
    /// Counts.
    pub position: i32,
    /// Estimated.
    pub velocity: CountsPerSecond,
    /// The control value; 0 while coasting.
    pub control: Control,
    /// Its regime; `None` while the bridge is open because the motor is disabled, floating or at fault.
    pub regime: Option<Regime>,
    /// What the bridge is told.
    pub drive: Drive,
    /// In regulated position and within the tolerance.
    pub at_target: bool,
    /// Regulated, under effort, and held against a stop.
    pub stalled: bool,
    /// What keeps it from obeying.
    pub faults: Faults,
}

impl Report {
    /// A disabled motor of which nothing is known.
    pub const INITIAL: Self = Self {
        setpoint: Setpoint::Disabled,
        position: 0,
        velocity: CountsPerSecond::ZERO,
        control: Control::ZERO,
        regime: None,
        drive: Drive::COAST,
        at_target: false,
        stalled: false,
        faults: Faults { battery_unknown: false, encoder_stale: false, encoder: None },
    };
}

/// Settings, set-point and state of one motor.
#[derive(Clone, Debug)]
pub struct Motor {
    settings: Settings,
    setpoint: Setpoint,
    period: Period,
    tick: Tick,
    velocity: VelocityEstimator,
    velocity_loop: Pid,
    position_loop: Pid,
    guard: Guard,
    /// Latched until the motor is disabled.
    encoder_fault: Option<EncoderFault>,
    stalled: bool,
    position: i32,
    /// Counts since the last tick.
    moved: i32,
    /// The velocity loop's set-point and output at the last tick; 0 if it was not in use.
    asked: CountsPerSecond,
    applied: Control,
    /// The regime that it was given.
    regime: Regime,
    /// The last control value had no effect.
    coasting: bool,
}

impl Motor {
    /// A disabled motor that is stepped every `period`.
    pub fn new(settings: Settings, period: Period) -> Self {
        Self {
            settings,
            setpoint: Setpoint::Disabled,
            period,
            tick: Tick::new(period),
            velocity: VelocityEstimator::new(period),
            velocity_loop: Pid::default(),
            position_loop: Pid::default(),
            guard: Guard::default(),
            encoder_fault: None,
            stalled: false,
            position: 0,
            moved: 0,
            asked: CountsPerSecond::ZERO,
            applied: Control::ZERO,
            regime: Regime::Braking,
            coasting: true,
        }
    }

    /// Takes effect at the next step, as a whole. State is kept, so coefficients may be tuned while
    /// the motor runs.
    pub const fn configure(&mut self, settings: Settings) {
        self.settings = settings;
    }

    /// Takes effect at the next step. A change of run mode starts its loops afresh; disabling the
    /// motor ends a latched fault.
    pub fn set(&mut self, setpoint: Setpoint) {
        if setpoint.regulation() != self.setpoint.regulation() {
            self.velocity_loop.reset();
            self.position_loop.reset();
        }
        if setpoint == Setpoint::Disabled {
            self.encoder_fault = None;
        }
        self.setpoint = setpoint;
    }

    /// The settings in force.
    pub const fn settings(&self) -> &Settings {
        &self.settings
    }

    /// One control tick.
    ///
    /// Kept apart from its callers, which are generic and so compiled with a board's optimisation; this is
    /// compiled with the library's.
    #[inline(never)]
    pub fn step(&mut self, now: Micros, reading: Option<Reading>, battery: Option<Millivolts>) -> Report {
        let fresh = reading.is_some_and(|reading| now.wrapping_since(reading.at) <= STALE_MICROS);
        let velocity = match reading {
            Some(reading) if fresh => {
                self.moved = reading.position.wrapping_sub(self.position);
                self.position = reading.position;
                self.velocity.step(reading)
            }
            _ => self.velocity.get(),
        };
        let operating_point =
            battery.and_then(|battery| OperatingPoint::new(self.settings.emf.emf(velocity), battery));

        let output = operating_point.and_then(|at| self.output(at, velocity, fresh));
        self.coasting = output.is_none();
        if self.coasting || self.setpoint.regulation() == Regulation::None {
            self.unwatch();
        }
        let (control, regime, drive) = match output {
            Some((control, Placement { regime, drive })) => (control, Some(regime), drive),
            None => (Control::ZERO, None, Drive::COAST),
        };
        Report {
            setpoint: self.setpoint,
            position: self.position,
            velocity,
            control,
            regime,
            drive,
            at_target: self.at_target(),
            stalled: self.stalled,
            faults: Faults {
                battery_unknown: battery.is_none(),
                encoder_stale: !fresh,
                encoder: self.encoder_fault,
            },
        }
    }

    /// Control value and its placement, or `None` to coast.
    fn output(
        &mut self,
        at: OperatingPoint,
        velocity: CountsPerSecond,
        encoder: bool,
    ) -> Option<(Control, Placement)> {
        let target = match self.setpoint {
            Setpoint::Disabled => return None,
            Setpoint::ConstantPower(power) => return self.open_loop(at, power).map(|p| (power, p)),
            _ if !encoder || self.encoder_fault.is_some() => return None,
            Setpoint::Velocity(target) if target == CountsPerSecond::ZERO && self.floats() => {
                self.velocity_loop.reset();
                return None;
            }
            Setpoint::Velocity(target) => target,
            Setpoint::Position { target, speed_limit, .. } => self.approach(target, speed_limit),
        };
        let mut probe = None;
        // What the encoder's answer to the last tick's control value says of the encoder.
        if !self.guard.trusts(self.applied, self.regime, self.moved) {
            match self.watch(velocity) {
                Finding::Fault(fault) => {
                    self.encoder_fault = Some(fault);
                    return None;
                }
                Finding::Probe(control) => probe = Some(control),
                Finding::Insist => {
                    let end = if self.applied < Control::ZERO { Control::MIN } else { Control::MAX };
                    (self.asked, self.applied) = (target, end);
                    return Some((end, braking::full_reverse(at)));
                }
                Finding::Sound | Finding::Stalled => (),
            }
        }
        let control = match probe {
            Some(control) => control,
            None => self.regulate(target, velocity),
        };
        self.asked = target;
        self.applied = control;
        let placement = self.settings.duty.place(self.settings.scheme, at, control);
        self.regime = placement.regime;
        Some((control, placement))
    }

    /// The velocity loop: the control value for a set-point.
    fn regulate(&mut self, target: CountsPerSecond, velocity: CountsPerSecond) -> Control {
        let (target, measured) = (target.to_bits(), velocity.to_bits());
        let output = self.velocity_loop.step(
            &self.settings.velocity,
            self.tick,
            PidInput {
                error: target.saturating_sub(measured),
                measured,
                feed_forward: target,
                limit: i32::from(Control::MAX.get()) << 8,
                hold: self.coasting,
            },
        );
        // Within the limit, which is the control range.
        Control::new(((output + (1 << 7)) >> 8) as i16)
    }

    /// The encoder is not above suspicion.
    fn watch(&mut self, velocity: CountsPerSecond) -> Finding {
        let finding = self.guard.examine(
            self.period,
            Evidence {
                control: self.applied,
                regime: self.regime,
                target: self.asked,
                moved: self.moved,
                velocity,
                gentle: matches!(self.settings.scheme, Scheme::C | Scheme::D(_)),
            },
        );
        self.stalled = finding == Finding::Stalled;
        finding
    }

    /// Nothing is expected of the encoder.
    fn unwatch(&mut self) {
        self.guard = Guard::default();
        self.stalled = false;
        self.asked = CountsPerSecond::ZERO;
        self.applied = Control::ZERO;
    }

    fn floats(&self) -> bool {
        self.settings.zero_power == ZeroPower::Float
    }

    /// A host that sets a power means the duty of 9/8 or 6/2, so no scheme comes between.
    fn open_loop(&self, at: OperatingPoint, power: Control) -> Option<Placement> {
        if power != Control::ZERO {
            return Some(braking::place(Scheme::ForwardReverse, at, power));
        }
        (!self.floats()).then_some(Placement { regime: Regime::Braking, drive: Drive::BRAKE })
    }

    /// The position loop: the velocity to go at now.
    fn approach(&mut self, target: i32, speed_limit: CountsPerSecond) -> CountsPerSecond {
        // From 8 million counts on it is far enough.
        let distance = target.wrapping_sub(self.position).clamp(-FAR, FAR);
        let bits = self.position_loop.step(
            &self.settings.position,
            self.tick,
            PidInput {
                error: distance << 8,
                measured: self.position.wrapping_shl(8),
                feed_forward: 0,
                limit: speed_limit.to_bits().saturating_abs(),
                hold: self.coasting,
            },
        );
        CountsPerSecond::from_bits(bits)
    }

    fn at_target(&self) -> bool {
        match self.setpoint {
            Setpoint::Position { target, tolerance, .. } => {
                target.wrapping_sub(self.position).unsigned_abs() <= u32::from(tolerance)
            }
            _ => false,
        }
    }
}
