//! Types of a checked scenario.

use super::expectation::Expectation;
use super::numbers::{Capacitance, DragFactor, Factor, within};
use crate::bno055::GyroErrors;
use crate::current_line::CurrentLine;
use crate::encoder::Encoder;
use crate::ground::Floor;
use crate::hardware::{BRIDGE, mechanics, winding};
use crate::i2c::Fault;
use motor_hub::braking::{DutyRule, Scheme, Winding};
use motor_hub::bridge::BridgeConstants;
use motor_hub::group::{BaseSettings, DriveBase, GroupCommand};
use motor_hub::hub::Command;
use motor_hub::model::friction::Friction;
use motor_hub::model::load::Load;
use motor_hub::model::plant::Temperatures;
use motor_hub::model::train::Train;
use motor_hub::model::{battery::Battery, catalogue, si};
use motor_hub::motion::Pidf;
use motor_hub::motor::{OnFault, Setpoint, Settings, ThermalLimit, ZeroPower};
use motor_hub::protocol::pins::Pin;
use motor_hub::regulator::{Coefficients, Dynamics, Mechanics};
use motor_hub::supply::{Levels, Limits};
use motor_hub::units::{Acceleration, Millivolts, Period, RangeError, constant};
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use std::num::NonZeroU16;

/// Limits that never act: the hub accepts any battery from 5 to 18 V, and dissipates no energy.
const UNLIMITED: Limits = constant!(Limits::new(Levels {
    min: Millivolts::new(5_000),
    cutoff: Millivolts::new(5_000),
    derate: Millivolts::new(5_001),
    recover: Millivolts::new(5_001),
    dissipate: Millivolts::new(17_999),
    ceiling: Millivolts::new(18_000),
    max: Millivolts::new(18_000),
}));

/// A run: its motors, its battery, its length.
#[derive(Clone, Debug, PartialEq)]
pub struct Scenario {
    /// A title for reports.
    pub name: String,
    /// Length of the run in seconds.
    pub duration_s: f64,
    /// The hub's control period.
    pub period: Period,
    /// Seed of the measurement noise.
    pub seed: u64,
    /// The supply at the start.
    pub battery: Battery,
    /// The bus between battery and bridges; `None` if the bridges are connected to the battery directly.
    pub bus: Option<Bus>,
    /// True if the hub's limits of the supply voltage never act. A scenario with a bus has the limits of the bus.
    pub unlimited: bool,
    /// Voltage of the battery without load in volts, at ascending times. Between two times the voltage is interpolated
    /// linearly. After the last time it stays constant.
    pub emf_over_time: Vec<Timed<f64>>,
    /// One to [`MOTORS`](crate::hardware::MOTORS) motors.
    pub motors: Vec<Motor>,
    /// Motors that move in step.
    pub groups: Vec<Group>,
    /// A wire between two of the hub's digital pins, for a host that tests them.
    pub wire: Option<[Pin; 2]>,
    /// What is connected to the hub's pins and I2C buses at the start.
    pub attached: Attached,
    /// Later changes of what is connected, times ascending.
    pub attached_over_time: Vec<Timed<Attached>>,
    /// The floor of the drive base whose left wheel motor 0 drives, and whose right wheel motor 1 drives.
    pub floor: Floor,
    /// Errors of the gyro that stands on the drive base of motors 0 and 1.
    pub gyro: GyroErrors,
    /// True if a test runs the scenario on the emulated chip too.
    pub emulated: bool,
    /// Expectations of the run; empty for a scenario that is no test.
    pub expectations: Vec<Expectation>,
}

/// What is connected to the hub's pins and I2C buses, from a time on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attached {
    /// Voltages at the analog inputs from input 0, in volts. Further inputs stay as they are: open at the start.
    pub analog_v: Vec<f64>,
    /// All digital pins that are connected to ground. `None` leaves the connections as they are; at the start no pin is
    /// connected.
    pub low_pins: Option<Vec<Pin>>,
    /// Conditions of the I2C buses from bus 0. Further buses stay as they are: they work at the start.
    pub i2c_faults: Vec<Fault>,
}

/// The bus of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bus {
    /// Capacitance in farads.
    #[serde(deserialize_with = "within::<Capacitance, _, _>")]
    pub capacitance_f: f64,
    /// True if the battery gives current and accepts none.
    #[serde(default)]
    pub one_way: bool,
    /// Time at which a contactor disconnects the battery, in seconds since the start; `None` for never.
    pub opens_at_s: Option<f64>,
    /// The hub's limits of the supply voltage.
    #[serde(default, rename = "burn_between_v", deserialize_with = "burn_between_v")]
    pub limits: Limits,
}

/// Reads the voltages between which the hub dissipates energy.
fn burn_between_v<'de, D: Deserializer<'de>>(from: D) -> Result<Limits, D::Error> {
    let between = <[f64; 2]>::deserialize(from)?;
    let usual = Limits::TWELVE_VOLTS.levels();
    let limits = match between.map(Millivolts::from_volts) {
        [Ok(dissipate), Ok(ceiling)] => Limits::new(Levels { dissipate, ceiling, ..usual }).ok(),
        _ => None,
    };
    limits.ok_or_else(|| {
        Error::custom(format!(
            "= {between:?} is out of range; it needs [low, high] with low above {} V, below high, and high up to {} V",
            usual.recover.to_volts(),
            usual.max.to_volts()
        ))
    })
}

/// One motor of a scenario.
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    /// The label in reports.
    pub label: String,
    /// The constants, with the chosen inertia.
    pub constants: catalogue::Motor,
    /// Load of the output shaft; its torque is in `torques`.
    pub load: Load,
    /// Backlash and a compliant shaft between motor and load; `None` if the load is fixed to the motor.
    pub train: Option<Train>,
    /// The hub's configuration, relative to the constants.
    pub configuration: Configuration,
    /// Scheme, which says what control values mean.
    pub scheme: Scheme,
    /// Rule for duties within a regime.
    pub duty: DutyRule,
    /// Behaviour at power 0 or speed 0.
    pub zero_power: ZeroPower,
    /// Behaviour at a fault.
    pub on_fault: OnFault,
    /// The bridge; the hub is configured for it.
    pub bridge: BridgeConstants,
    /// The bridge's current-sense line.
    pub current_line: CurrentLine,
    /// Thermal limit configured in the hub; `None` for no limit.
    pub thermal: Option<ThermalLimit>,
    /// Current limit configured in the hub, in milliamperes; `None` for no limit.
    pub current_limit: Option<NonZeroU16>,
    /// Largest acceleration of the model's profiles; `None` for the acceleration that the battery gives.
    pub acceleration: Option<Acceleration>,
    /// Coefficients of the velocity loop. `None` for the model regulator, or for the suggested ones if `position` is
    /// set.
    pub velocity: Option<Pidf>,
    /// Coefficients of the position loop. `None` for the model regulator, or for the suggested ones if `velocity` is
    /// set.
    pub position: Option<Pidf>,
    /// Set-points, times ascending; before the first the motor is disabled.
    pub setpoints: Vec<Timed<Setpoint>>,
    /// External torque on the output shaft in newton metres, times ascending, from 0 s on.
    pub torques: Vec<Timed<f64>>,
    /// Temperatures of the motor at ascending times. From a cold motor at 0 s to the first time, and between two times,
    /// the temperatures are interpolated linearly. After the last time they stay constant.
    pub heat: Vec<Timed<Temperatures>>,
    /// States of the encoder at ascending times. Before the first time the encoder is sound.
    pub encoder: Vec<Timed<Encoder>>,
}

/// Motors of a scenario that move in step.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// The label in reports.
    pub label: String,
    /// Indices of the members among the motors of the scenario.
    pub motors: Vec<usize>,
    /// The drive base whose wheels are the two members; `None` if the group is no drive base.
    pub base: Option<DriveBase>,
    /// True if the hub regulates the heading of the base by its gyro.
    pub use_gyro: bool,
    /// Courses, times ascending.
    pub courses: Vec<Timed<GroupCommand>>,
}

/// A motor's configuration in the hub, in factors of the true constants. Inertia, drag and friction are with the load.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Configuration {
    /// The motor whose constants are configured; `None` for the constants of the motor itself.
    #[serde(skip)]
    pub of: Option<catalogue::Motor>,
    /// False for an unknown motor: only its winding is configured.
    #[serde(skip)]
    pub is_motion_known: bool,
    /// Factor of the winding resistance.
    #[serde(deserialize_with = "within::<Factor, _, _>")]
    pub resistance: f64,
    /// Factor of the back-EMF constant and of the torque constant, which both depend on the magnets.
    #[serde(deserialize_with = "within::<Factor, _, _>")]
    pub emf: f64,
    /// Factor of the moment of inertia.
    #[serde(deserialize_with = "within::<Factor, _, _>")]
    pub inertia: f64,
    /// Factor of the viscous drag.
    #[serde(deserialize_with = "within::<DragFactor, _, _>")]
    pub drag: f64,
    /// Factor of the Coulomb friction.
    #[serde(deserialize_with = "within::<Factor, _, _>")]
    pub friction: f64,
}

impl Group {
    /// The settings of the hub's drive base; `None` for a group without a gyro, because its odometry is not used.
    fn base_settings(&self) -> Option<BaseSettings> {
        let (base, &[left, right]) = (self.base.filter(|_| self.use_gyro)?, self.motors.as_slice()) else {
            return None;
        };
        BaseSettings::new([left as u8, right as u8], &base, true).ok()
    }
}

impl Configuration {
    /// The true constants are configured.
    pub const EXACT: Self = Self {
        of: None,
        is_motion_known: true,
        resistance: 1.0,
        emf: 1.0,
        inertia: 1.0,
        drag: 1.0,
        friction: 1.0,
    };
}

impl Default for Configuration {
    fn default() -> Self {
        Self::EXACT
    }
}

/// A value that is in force from a time on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timed<T> {
    /// Seconds since the start.
    pub at_s: f64,
    /// The value from then on.
    pub value: T,
}

impl Scenario {
    /// Creates a scenario of these motors without expectations. It takes `duration_s` seconds, with a control period of
    /// 50 ms and a constant battery of 12 V with 0.05 ohms.
    pub fn new(name: &str, duration_s: f64, motors: Vec<Motor>) -> Self {
        Self {
            name: name.to_owned(),
            duration_s,
            period: Period::DEFAULT,
            seed: 1,
            battery: Battery { emf: si::Volts(12.0), resistance: si::Ohms(0.05) },
            bus: None,
            unlimited: false,
            emf_over_time: Vec::new(),
            motors,
            groups: Vec::new(),
            wire: None,
            attached: Attached::default(),
            attached_over_time: Vec::new(),
            floor: Floor::default(),
            gyro: GyroErrors::default(),
            emulated: false,
            expectations: Vec::new(),
        }
    }

    /// Returns the parts of this scenario that the emulated board lacks, in the words of error messages.
    pub fn not_emulated(&self) -> impl Iterator<Item = &'static str> {
        let any = |has: fn(&Motor) -> bool| self.motors.iter().any(has);
        let is_attached = self.attached != Attached::default() || !self.attached_over_time.is_empty();
        let parts = [
            ("a bus ([bus])", self.bus.is_some()),
            ("other limits of the supply voltage (battery.unlimited)", self.limits() != Limits::TWELVE_VOLTS),
            ("a connection of a pin or an I2C bus ([attached])", is_attached),
            ("a floor ([floor])", self.floor != Floor::default()),
            ("an error of a gyro ([gyro])", self.gyro != GyroErrors::default()),
            ("a train between motor and load (motors.train)", any(|motor| motor.train.is_some())),
            ("a temperature of a motor (motors.heat)", any(|motor| !motor.heat.is_empty())),
        ];
        parts.into_iter().filter_map(|(part, is_present)| is_present.then_some(part))
    }

    /// Returns the parts of this scenario that a replay on the emulated board does not run: also groups, because the lines of
    /// a chip do not show the references of a group.
    pub fn not_replayed(&self) -> impl Iterator<Item = &'static str> {
        (!self.groups.is_empty()).then_some("a group ([[groups]])").into_iter().chain(self.not_emulated())
    }

    /// The hub's limits of the supply voltage.
    pub fn limits(&self) -> Limits {
        let usual = if self.unlimited { UNLIMITED } else { Limits::TWELVE_VOLTS };
        self.bus.map_or(usual, |bus| bus.limits)
    }

    /// Voltage of the battery without load at a time in seconds.
    pub fn emf_at(&self, at_s: f64) -> si::Volts {
        let emf = self.emf_over_time.iter().map(|timed| (timed.at_s, timed.value));
        si::Volts(on_lines(self.battery.emf.0, emf, at_s))
    }

    /// The hub's commands in the order of their times. Commands of the same time are in the order of the motors, and
    /// the commands of groups come last.
    pub fn commands(&self) -> Vec<Timed<Command>> {
        let mut commands = Vec::new();
        for (motor, plan) in self.motors.iter().enumerate() {
            commands.extend(plan.setpoints.iter().map(|&Timed { at_s, value }| Timed {
                at_s,
                value: Command::Set { motor, setpoint: value },
            }));
        }
        for group in &self.groups {
            commands.extend(
                group.base_settings().map(|base| Timed { at_s: 0.0, value: Command::SetBase(Some(base)) }),
            );
            commands.extend(
                group
                    .courses
                    .iter()
                    .map(|&Timed { at_s, value }| Timed { at_s, value: Command::MoveGroup(value) }),
            );
        }
        commands.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        commands
    }

    /// The same motors and loads without external torques.
    #[must_use]
    pub fn undisturbed(mut self) -> Self {
        self.motors.iter_mut().for_each(|motor| motor.torques.clear());
        self
    }

    /// The same run without a braking regime: forward and reverse driving only.
    #[must_use]
    pub fn without_braking(&self) -> Self {
        let mut other = self.clone();
        for motor in &mut other.motors {
            motor.scheme = Scheme::ForwardReverse;
        }
        other
    }
}

impl Motor {
    /// A motor that is configured exactly, under Scheme A with linear current, without set-points and torques.
    pub fn new(constants: catalogue::Motor, load: Load) -> Self {
        Self {
            label: constants.name.to_owned(),
            constants,
            load,
            train: None,
            configuration: Configuration::EXACT,
            scheme: Scheme::A,
            duty: DutyRule::LinearCurrent,
            zero_power: ZeroPower::Brake,
            on_fault: OnFault::Coast,
            bridge: BRIDGE,
            current_line: CurrentLine::Absent,
            thermal: None,
            current_limit: None,
            acceleration: None,
            velocity: None,
            position: None,
            setpoints: Vec::new(),
            torques: vec![Timed { at_s: 0.0, value: 0.0 }],
            heat: Vec::new(),
            encoder: Vec::new(),
        }
    }

    /// The hub's settings for this motor.
    ///
    /// # Errors
    /// If one of the motor's constants does not fit the firmware's range.
    pub fn settings(&self) -> Result<Settings, RangeError> {
        let Configuration { of, is_motion_known, resistance, emf, .. } = self.configuration;
        let motor = of.unwrap_or(self.constants);
        let configured = catalogue::Motor {
            r: si::Ohms(motor.r.0 * resistance),
            ke: si::EmfConstant(motor.ke.0 * emf),
            kt: si::TorqueConstant(motor.kt.0 * emf),
            ..motor
        };
        let winding = winding(&configured)?;
        let suggested = Coefficients::suggested(winding.emf);
        let own = self.velocity.is_some() || self.position.is_some();
        Ok(Settings {
            bridge: self.bridge,
            duty: self.duty,
            zero_power: self.zero_power,
            on_fault: self.on_fault,
            thermal: self.thermal,
            current_limit: self.current_limit,
            acceleration: self.acceleration,
            dynamics: is_motion_known.then(|| self.dynamics(&configured, &winding)).transpose()?,
            coefficients: own.then(|| Coefficients {
                velocity: self.velocity.unwrap_or(suggested.velocity),
                position: self.position.unwrap_or(suggested.position),
            }),
            ..Settings::for_scheme(winding, self.scheme)
        })
    }

    fn dynamics(&self, configured: &catalogue::Motor, winding: &Winding) -> Result<Dynamics, RangeError> {
        let truth = mechanics(configured, &self.load);
        let Configuration { inertia, drag, friction, .. } = self.configuration;
        let mechanics = Mechanics {
            inertia: truth.inertia * inertia,
            drag: truth.drag * drag,
            friction: truth.friction * friction,
            ..truth
        };
        Dynamics::from_mechanics(winding, &BRIDGE, &mechanics)
    }

    /// Gives the motor Coulomb friction, in percent of its stall torque at 12 V.
    pub fn set_friction(&mut self, percent: f64) {
        let stall = self.constants.stall_torque(si::Volts(12.0));
        self.constants.friction = Friction::with_coulomb(si::NewtonMetres(percent / 100.0 * stall.0));
    }

    /// The set-point that is in force at a time in seconds.
    pub fn setpoint_at(&self, at_s: f64) -> Setpoint {
        latest(&self.setpoints, at_s).unwrap_or_default()
    }

    /// The external torque in newton metres that acts at a time in seconds.
    pub fn torque_at(&self, at_s: f64) -> f64 {
        latest(&self.torques, at_s).unwrap_or_default()
    }

    /// The temperatures of the motor at a time in seconds.
    pub fn temperatures_at(&self, at_s: f64) -> Temperatures {
        let of = |part: fn(&Temperatures) -> f64| {
            on_lines(0.0, self.heat.iter().map(|timed| (timed.at_s, part(&timed.value))), at_s)
        };
        Temperatures { winding_k: of(|heat| heat.winding_k), magnets_k: of(|heat| heat.magnets_k) }
    }

    /// The state of the encoder at a time in seconds.
    pub fn encoder_at(&self, at_s: f64) -> Encoder {
        latest(&self.encoder, at_s).unwrap_or_default()
    }
}

/// Interpolates linearly from `first` at 0 s through these times and values. After the last time the last value is
/// returned.
fn on_lines(first: f64, points: impl Iterator<Item = (f64, f64)>, at_s: f64) -> f64 {
    let (mut from, mut value) = (0.0, first);
    for (to, next) in points {
        if at_s < to {
            return value + (at_s - from) / (to - from) * (next - value);
        }
        (from, value) = (to, next);
    }
    value
}

/// The value that is in force at `at_s`; `None` before the first time.
fn latest<T: Copy>(timed: &[Timed<T>], at_s: f64) -> Option<T> {
    timed.iter().take_while(|t| t.at_s <= at_s).last().map(|t| t.value)
}
