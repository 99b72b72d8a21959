//! Proportional braking: maps a voltage or a control value to the mode and duty of the bridge.
//!
//! The voltages of a motor are divided into three *regimes*. The points S, T, Z and G of *the paper* (R. Atkinson, *On
//! Proportional Braking in H Bridges*, 2018) are the ends of the regimes. For a motor that turns CW with the back EMF e
//! on a battery of V volts, these ends are the same voltages in every scheme:
//!
//! ```text
//!   S = -V                T = 0                Z = e               G = V
//!     |--- reverse, 6/2 ---|--- braking, 5/0 ---|--- forward, 9/8 ---|
//! ```
//!
//! * A *control value* is a number from -32767 to 32767. The output of a PID loop is a control value. A motor's report
//!   also gives the command as a control value.
//! * A [`Scheme`] maps control values to voltages. The scheme's [`Points`] are the control values of the voltages S, T,
//!   Z and G.
//! * The [`Location`] of a control value is its regime, and the fraction of the regime. A [`DutyRule`] maps the
//!   location to a duty.
//! * A [`Modulator`] has both maps for one motor, and their inverses.
//!
//! In this module a voltage is the equivalent DC voltage of the motor's mean current: e plus the current times the
//! resistance of the winding and two switches.
//!
//! ```
//! use motor_hub::braking::{DutyRule, Modulator, OperatingPoint, Regime, Scheme, Winding};
//! use motor_hub::bridge::{BridgeConstants, Mode};
//! use motor_hub::units::{CountsPerSecond, Millivolts, Voltage};
//!
//! // A NeveRest 60 at half of its free speed on 12 V gets 4 V. This is less than the back EMF of 6 V, so the bridge
//! // brakes in proportion. In Scheme A the control value for 4 V is a third of 32767.
//! let winding = Winding::NEVEREST_60;
//! let modulator = Modulator::new(&winding, &BridgeConstants::IDEAL, Scheme::A, DutyRule::LinearCurrent);
//! let emf = winding.emf.emf(CountsPerSecond::new(1505));
//! let at = OperatingPoint::new(emf, Millivolts::new(12_000)).expect("there is a battery");
//! let drive = modulator.for_voltage(at, Voltage::from_volts(4.0)).drive;
//! assert_eq!((at.regime(drive), drive.mode), (Regime::Braking, Mode::Brake50));
//! assert_eq!(modulator.control(at, Voltage::from_volts(4.0)).get(), 10_922);
//! ```

pub mod linear_current;
pub mod points;
pub mod scheme;

pub use linear_current::LinearCurrent;
pub use points::{Fraction, Location, OperatingPoint, Points, Regime, UnboundedControl};
pub use scheme::{Blend, BlendFraction, Scheme};

use crate::bridge::{BridgeConstants, Drive};
use crate::units::{Control, Duty, EmfConstant, Inductance, Resistance, Voltage, constant};

/// Electrical constants of a motor's winding. The back EMF is per encoder speed.
///
/// The duties of [linear current](mod@linear_current) depend little on resistance and inductance: an error of a
/// factor of two is tolerable. If the inductance is unknown, the formulas treat the current as continuous, as at a high
/// PWM frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Winding {
    /// Back EMF per encoder speed.
    pub emf: EmfConstant,
    /// Resistance at the terminals.
    pub resistance: Resistance,
    /// Inductance; `None` if unknown.
    pub inductance: Option<Inductance>,
}

impl Winding {
    /// An AndyMark NeveRest 60: 3.3 ohm, 694 uH, 533/30000 V s/rad and 28 counts per revolution of the motor, which is
    /// 3.98683 mV s/count. These constants are a fair guess for any 12 V gear motor of a robot.
    pub const NEVEREST_60: Self = Self {
        emf: constant!(EmfConstant::from_ke(533.0 / 30_000.0, 28.0)),
        resistance: constant!(Resistance::from_ohms(3.3)),
        inductance: Some(constant!(Inductance::from_millihenries(0.694))),
    };
}

/// A command of the bridge, and the voltage that the command applies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modulation {
    /// Command of the bridge.
    pub drive: Drive,
    /// Equivalent DC voltage that the command applies.
    pub voltage: Voltage,
    /// Change of the mean current at a constant duty, as a voltage, per change of the back EMF. The share is 1 for a
    /// continuous current, and 0 to 1 for a [discontinuous](mod@linear_current) current. A higher back EMF reduces a
    /// driving current and raises a braking current.
    pub emf_share: f32,
}

impl Modulation {
    /// Full dynamic braking: the bridge shorts the winding all the time.
    pub const BRAKE: Self = Self { drive: Drive::BRAKE, voltage: Voltage::ZERO, emf_share: 1.0 };
}

/// Power of a braking motor. One part returns to the supply bus, the rest heats winding and bridge. Each part is at
/// least 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BrakingPower {
    /// Power that returns to the bus, in W.
    pub returned_watts: f32,
    /// Power that winding and bridge dissipate, in W.
    pub dissipated_watts: f32,
}

impl BrakingPower {
    /// The power of a motor that does not brake.
    pub const NONE: Self = Self { returned_watts: 0.0, dissipated_watts: 0.0 };
}

/// Map from a location within a regime to a duty.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum DutyRule {
    /// Between two points the duty is linear in the control value, as in the paper.
    LinearDuty,
    /// Between two points the motor's mean current is linear in the control value.
    #[default]
    LinearCurrent,
}

impl DutyRule {
    /// Both rules.
    pub const ALL: [Self; 2] = [Self::LinearCurrent, Self::LinearDuty];
}

/// Maps voltages and control values of one motor to commands of its bridge, and back.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Modulator {
    scheme: Scheme,
    rule: DutyRule,
    current: LinearCurrent,
}

impl Modulator {
    /// Prepares the constants of the winding and its bridge.
    pub fn new(winding: &Winding, bridge: &BridgeConstants, scheme: Scheme, rule: DutyRule) -> Self {
        Self { scheme, rule, current: LinearCurrent::new(winding, bridge) }
    }

    /// Returns the command that applies a requested voltage, as [`limited`](Self::limited) does with two differences. If
    /// the bridge's timing does not permit the duty, the command has the nearest permitted duty.
    /// [`Scheme::ForwardReverse`] has no braking regime: with this scheme the bridge opens for a voltage between 0 and the
    /// back EMF.
    pub fn for_voltage(&self, at: OperatingPoint, voltage: Voltage) -> Modulation {
        let volts = clockwise_volts(at, voltage);
        let (regime, w) = points::current(volts, at);
        let opens = matches!(self.scheme, Scheme::ForwardReverse) && regime == Regime::Braking && volts > 0.0;
        self.in_regime(at, regime, self.current.duty(regime, at, if opens { 0.0 } else { w }))
    }

    /// Returns the command that applies a voltage, with every scheme. The formulas are those of
    /// [`DutyRule::LinearCurrent`], with either rule. A voltage out of the bridge's range gives the nearest voltage in
    /// the range. If the bridge's timing does not permit the duty, the command has the next lower permitted duty, whose
    /// current is smaller.
    ///
    /// The voltage 0 brakes a turning motor fully, and opens the bridge if the back EMF is 0.
    pub fn limited(&self, at: OperatingPoint, voltage: Voltage) -> Modulation {
        let (regime, w) = points::current(clockwise_volts(at, voltage), at);
        self.in_regime(at, regime, self.current.duty_at_most(regime, at, w))
    }

    /// Computes the voltage that a command applies: the inverse of [`for_voltage`](Self::for_voltage).
    pub fn modulation(&self, at: OperatingPoint, drive: Drive) -> Modulation {
        self.in_regime(at, at.regime(drive), drive.duty)
    }

    /// Returns the command with this duty in a regime, and the voltage that the command applies.
    fn in_regime(&self, at: OperatingPoint, regime: Regime, duty: Duty) -> Modulation {
        let (emf, _) = at.volts();
        let (current, emf_share) = self.current.current(regime, at, duty);
        let volts = if regime == Regime::Forward { emf + current } else { emf - current };
        let voltage = Voltage::from_volts(if at.counter_clockwise() { -volts } else { volts });
        Modulation { drive: at.drive(regime, duty), voltage, emf_share }
    }

    /// Returns the command for a control value, by the scheme and the duty rule.
    pub fn for_control(&self, at: OperatingPoint, control: Control) -> Modulation {
        match self.rule {
            DutyRule::LinearDuty => self.with_feasible_duty(at, linear_duty(self.scheme, at, control)),
            DutyRule::LinearCurrent => {
                self.modulation(at, linear_current(&self.current, self.scheme, at, control))
            }
        }
    }

    /// Returns the command for open-loop power. Positive power uses mode 9/8, and negative power mode 6/2, in every
    /// scheme. The duty is `|power| / 32767`, or the nearest duty that the bridge's timing permits. Power 0 opens the
    /// bridge.
    pub fn open_loop(&self, at: OperatingPoint, power: Control) -> Modulation {
        self.with_feasible_duty(at, linear_duty(Scheme::ForwardReverse, at, power))
    }

    /// Replaces the duty of a command by the nearest duty that the bridge's timing permits.
    fn with_feasible_duty(&self, at: OperatingPoint, drive: Drive) -> Modulation {
        self.modulation(at, Drive { duty: self.current.feasible(drive.duty), ..drive })
    }

    /// Returns the control value for a voltage. A voltage beyond the scheme's range gives the nearest control value.
    pub fn control(&self, at: OperatingPoint, voltage: Voltage) -> Control {
        let (regime, w) = points::current(clockwise_volts(at, voltage), at);
        let share = match self.rule {
            DutyRule::LinearCurrent => points::share(regime, w, at),
            DutyRule::LinearDuty => self.current.duty(regime, at, w).to_f32(),
        };
        clockwise(at, points::control(&Points::new(self.scheme, at), regime, share))
    }

    /// Returns the largest mean current that is [discontinuous](mod@linear_current) in the regime of this voltage, as the
    /// difference of a voltage from the back EMF, in V. The result is 0 if no current is discontinuous.
    pub fn discontinuous_volts(&self, at: OperatingPoint, voltage: Voltage) -> f32 {
        let (regime, _) = points::current(clockwise_volts(at, voltage), at);
        self.current.boundary(regime, at)
    }

    /// Computes the voltage beyond the back EMF, in V, with which a [discontinuous](mod@linear_current) current brings
    /// the motor to another back EMF by the end of a tick. The voltage applies at the beginning of the tick. Also
    /// returns the largest magnitude of such a voltage in V: with a larger result the current is continuous.
    ///
    /// `emf_change` is the change of the back EMF, and `load` the voltage beyond the back EMF that balances the load.
    /// Both are in V, and positive for CW. `n` is the length of the tick in mechanical time constants of the motor.
    /// `None` if no current is discontinuous, or if no discontinuous current reaches the back EMF.
    pub fn discontinuous_to(
        &self,
        at: OperatingPoint,
        emf_change: f32,
        load: f32,
        n: f32,
    ) -> Option<(f32, f32)> {
        let side = if at.counter_clockwise() { -1.0 } else { 1.0 };
        let (change, load) = (side * emf_change, side * load);
        let (emf, _) = at.volts();
        let (regime, _) = points::current(emf + change / n + load, at);
        let direction = if regime == Regime::Forward { 1.0 } else { -1.0 };
        let (current, boundary) = self.current.discontinuous_to(regime, at, change, direction * load, n)?;
        Some((side * direction * current, boundary))
    }

    /// Computes the braking power of a command. `ohms` is the resistance of winding and bridge.
    pub fn braking_power(&self, at: OperatingPoint, command: Modulation, ohms: f32) -> BrakingPower {
        let Modulation { drive, voltage, .. } = command;
        let (e, v) = at.volts();
        let current = (e - clockwise_volts(at, voltage)).max(0.0) / ohms;
        let braked = e * current;
        match at.regime(drive) {
            Regime::Forward => BrakingPower::NONE,
            Regime::Reverse => BrakingPower { returned_watts: 0.0, dissipated_watts: braked },
            Regime::Braking => {
                // Current flows into the bus only while the bridge is open. `share` is the part of the mean current
                // that flows in this time. If the current is continuous, `share` is the open share of the period. If
                // the current is discontinuous, the current rises and falls between 0 and the same peak, so `share` is
                // e / falling voltage.
                let open = 1.0 - drive.duty.to_f32();
                let share = open.min(e / self.current.falling_volts(v));
                let returned = (v * current * share).min(braked);
                BrakingPower { returned_watts: returned, dissipated_watts: braked - returned }
            }
        }
    }
}

/// Converts to volts, and for a motor that turns CCW negates the voltage, so that formulas for CW motion apply.
const fn clockwise_volts(at: OperatingPoint, voltage: Voltage) -> f32 {
    let volts = voltage.to_volts();
    if at.counter_clockwise() { -volts } else { volts }
}

/// Negates the control value of a motor that turns CCW, so that formulas for CW motion apply.
const fn clockwise(at: OperatingPoint, control: Control) -> Control {
    if at.counter_clockwise() { control.reversed() } else { control }
}

/// Returns the command for a control value by [`DutyRule::LinearDuty`] (paper, section 1.3).
pub const fn linear_duty(scheme: Scheme, at: OperatingPoint, control: Control) -> Drive {
    let Location { regime, fraction } = Points::new(scheme, at).locate(clockwise(at, control));
    at.drive(regime, fraction.to_duty())
}

/// Returns the command for a control value by [`DutyRule::LinearCurrent`].
pub fn linear_current(
    current: &LinearCurrent,
    scheme: Scheme,
    at: OperatingPoint,
    control: Control,
) -> Drive {
    let location = Points::new(scheme, at).locate(clockwise(at, control));
    let location = match location.regime {
        // In overrun the battery cannot drive a current, so the bridge opens.
        Regime::Forward if at.is_overrun() => Location { regime: Regime::Braking, fraction: Fraction::ZERO },
        _ => location,
    };
    at.drive(location.regime, current.duty(location.regime, at, location.current(at)))
}
