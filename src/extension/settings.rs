//! All settings of a motor, in one table of fields. The bytes on the line, stored records, documents (TOML, JSON) and the
//! options of programs follow from this table.
//!
//! ```text
//!              Values::of          Values::write
//! MotorSettings ------> Values ---------------> bytes on the line, and of a stored record
//!               <------        <---------------
//!                 put            Values::read
//! ```
//!
//! Fields stand in groups, since a request sets all fields of a group at once. Some groups are functions of the extension, the
//! others are requests of REV's protocol. A later firmware may add fields at the end of a group.
//!
//! ```
//! use motor_hub::braking::{Scheme, Winding};
//! use motor_hub::extension::Request;
//! use motor_hub::extension::settings::{Group, MotorSettings, Values};
//! use motor_hub::motor::Settings;
//!
//! // A NeveRest 60, Scheme B, linear current, on channel 2.
//! let settings = MotorSettings::new(Settings::for_scheme(Winding::NEVEREST_60, Scheme::B));
//! let request = Request::Set(2, Values::of(Group::SetUp, &settings));
//! assert_eq!(request.id(), 0x4D00);
//! assert_eq!(*request.payload(), [2, 0x0F, 0xCA, 0x3F, 0, 0xE4, 0x0C, 0xB6, 2, 2, 0, 0, 1]);
//!
//! let emf = Group::SetUp.fields()[0];
//! assert_eq!((emf.name, emf.range()), ("emf_mv_s_per_count", (1.0 / 1_048_576.0, 32.0 - 1.0 / 1_048_576.0)));
//! ```

use super::FIRST_FUNCTION;
use crate::braking::{Blend, BlendFraction, DutyRule, Scheme, Winding};
use crate::bridge::Timing;
use crate::motion::Pidf;
use crate::motor::{OnFault, Settings, ThermalLimit, ZeroPower};
use crate::protocol::fields::{Field as _, Fields, Payload};
use crate::protocol::motor::{Algorithm, ChannelMode, Coefficients, Loop, RunMode};
use crate::protocol::{self, Nack, requests};
use crate::regulator::{self, Dynamics};
use crate::units::{
    Acceleration, AccelerationPerVolt, Coefficient, DecayRate, EmfConstant, Inductance, Millivolts, Period,
    Resistance,
};
use core::convert::Infallible;

/// Settings of one motor that a host can change and a hub can store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorSettings {
    /// Settings of the motor itself.
    pub motor: Settings,
    /// What regulates the motor.
    pub mode: RunMode,
    /// Current above which the hub reports an alert, in milliamperes; 0 for no alert.
    pub current_alert_ma: u16,
    /// How the host means the coefficients of the velocity loop.
    pub velocity_algorithm: Algorithm,
    /// How the host means the coefficients of the position loop.
    pub position_algorithm: Algorithm,
}

impl MotorSettings {
    /// Settings of a motor before a host has set anything: open loop, no current alert.
    pub const fn new(motor: Settings) -> Self {
        let (velocity_algorithm, position_algorithm) = (Algorithm::Pidf, Algorithm::Pidf);
        Self { motor, mode: RunMode::Power, current_alert_ma: 0, velocity_algorithm, position_algorithm }
    }

    /// What regulates the motor, and whether the motor floats at zero, in terms of REV's protocol.
    pub fn channel_mode(&self) -> ChannelMode {
        let floats = protocol::fields::Flag(self.motor.zero_power == ZeroPower::Float);
        ChannelMode { mode: self.mode, floats }
    }

    /// Sets what [`channel_mode`](Self::channel_mode) returns.
    pub const fn set_channel_mode(&mut self, ChannelMode { mode, floats }: ChannelMode) {
        self.mode = mode;
        self.motor.zero_power = if floats.0 { ZeroPower::Float } else { ZeroPower::Brake };
    }

    /// Coefficients of a loop: those that a host has set, or the guess for a motor without a known load.
    pub fn coefficients(&self, of: Loop) -> Coefficients {
        let both = self.both_loops();
        let (Pidf { p, i, d, f }, algorithm) = match of {
            Loop::Velocity => (both.velocity, self.velocity_algorithm),
            Loop::Position => (both.position, self.position_algorithm),
        };
        Coefficients { p, i, d, f, algorithm }
    }

    /// Sets the coefficients of a loop. From then on PID regulates the motor.
    pub fn set_coefficients(&mut self, of: Loop, coefficients: Coefficients) {
        let Coefficients { p, i, d, f, algorithm } = coefficients;
        let (mut both, pidf) = (self.both_loops(), Pidf { p, i, d, f });
        match of {
            Loop::Velocity => (both.velocity, self.velocity_algorithm) = (pidf, algorithm),
            Loop::Position => (both.position, self.position_algorithm) = (pidf, algorithm),
        }
        self.motor.coefficients = Some(both);
    }

    fn both_loops(&self) -> regulator::Coefficients {
        let Settings { winding, scheme, coefficients, .. } = self.motor;
        coefficients.unwrap_or_else(|| regulator::Coefficients::guessed(winding.emf, scheme, Period::DEFAULT))
    }
}

/// Fields that one request sets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Group {
    /// The connected motor, and the meaning of its control values. Setting this group deletes motion and coefficients, which
    /// belong to the motor that was connected before. A resistance of 0 keeps resistance and inductance.
    SetUp,
    /// How the motor's bridge switches.
    Timing,
    /// What keeps the motor and its load from harm.
    Protection,
    /// How the motor moves with its load, and its acceleration limit.
    Motion,
    /// REV's mode of the motor.
    Mode,
    /// REV's current alert.
    CurrentAlert,
    /// REV's coefficients of the velocity loop.
    VelocityLoop,
    /// REV's coefficients of the position loop.
    PositionLoop,
}

impl Group {
    /// All groups, in an order in which no group deletes what another group before it has set.
    pub const EACH: [Self; 8] = [
        Self::SetUp,
        Self::Timing,
        Self::Protection,
        Self::Motion,
        Self::Mode,
        Self::CurrentAlert,
        Self::VelocityLoop,
        Self::PositionLoop,
    ];

    /// The packet type of the request that sets the group, on hubs of this project. A stored record uses it too.
    pub const fn set_id(self) -> u16 {
        match self {
            Self::SetUp => FIRST_FUNCTION,
            Self::Motion => FIRST_FUNCTION + 2,
            Self::Protection => FIRST_FUNCTION + 8,
            Self::Timing => FIRST_FUNCTION + 11,
            Self::Mode => requests::FIRST_FUNCTION + 8,
            Self::CurrentAlert => requests::FIRST_FUNCTION + 12,
            Self::VelocityLoop | Self::PositionLoop => requests::FIRST_FUNCTION + 51,
        }
    }

    /// The packet type of the request that asks for the group, on hubs of this project.
    pub const fn get_id(self) -> u16 {
        match self {
            Self::VelocityLoop | Self::PositionLoop => requests::FIRST_FUNCTION + 53,
            _ => self.set_id() + 1,
        }
    }

    /// The loop whose coefficients the group has.
    const fn loop_of(self) -> Option<Loop> {
        match self {
            Self::VelocityLoop => Some(Loop::Velocity),
            Self::PositionLoop => Some(Loop::Position),
            _ => None,
        }
    }

    /// Appends the fields before the values, which name the motor and the loop.
    pub fn write_name(self, motor: u8, payload: &mut Payload) {
        motor.write(payload);
        if let Some(of) = self.loop_of() {
            of.write(payload);
        }
    }

    /// False for coefficients that no host has set. A hub stores only groups that are in use.
    pub const fn in_use(self, settings: &MotorSettings) -> bool {
        self.loop_of().is_none() || settings.motor.coefficients.is_some()
    }

    /// The fields in their order.
    pub const fn fields(self) -> &'static [Field] {
        match self {
            Self::SetUp => SET_UP,
            Self::Timing => TIMING,
            Self::Protection => PROTECTION,
            Self::Motion => MOTION,
            Self::Mode => MODE,
            Self::CurrentAlert => CURRENT_ALERT,
            Self::VelocityLoop => VELOCITY_LOOP,
            Self::PositionLoop => POSITION_LOOP,
        }
    }
}

/// A field of the table.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// The key in documents, which ends with the unit. A key with a dot belongs to a table of the document.
    pub name: &'static str,
    /// The meaning of the raw values.
    pub form: Form,
    /// True if the raw value 0 means that nothing is configured. A document then leaves out the key, and the table that the
    /// key belongs to.
    pub optional: bool,
    wire: Wire,
    least: i64,
    most: i64,
    get: fn(&MotorSettings) -> i64,
    put: fn(&mut MotorSettings, i64) -> Option<()>,
}

/// The meaning of a field's raw values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A number; this many steps of the raw value are one unit.
    Steps(u32),
    /// An index of one of these words.
    Words(&'static [&'static str]),
}

#[derive(Clone, Copy, Debug)]
enum Wire {
    U8,
    U16,
    U32,
    I32,
}

impl Field {
    /// The field with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Group::EACH.iter().flat_map(|group| group.fields()).find(|field| field.name == name)
    }

    /// A number with the whole range of its bytes.
    const fn number(name: &'static str, wire: Wire, steps: u32, get: Get, put: Put) -> Self {
        let (least, most) = match wire {
            Wire::U8 => (0, u8::MAX as i64),
            Wire::U16 => (0, u16::MAX as i64),
            Wire::U32 => (0, u32::MAX as i64),
            Wire::I32 => (i32::MIN as i64, i32::MAX as i64),
        };
        Self { name, form: Form::Steps(steps), optional: false, wire, least, most, get, put }
    }

    /// A byte, one for each word.
    const fn word(name: &'static str, words: &'static [&'static str], get: Get, put: Put) -> Self {
        let most = words.len() as i64 - 1;
        Self { name, form: Form::Words(words), optional: false, wire: Wire::U8, least: 0, most, get, put }
    }

    const fn within(self, least: i64, most: i64) -> Self {
        Self { least, most, ..self }
    }

    const fn or_none(self) -> Self {
        Self { optional: true, ..self }
    }

    /// The raw value of the field in these settings.
    pub fn get(&self, settings: &MotorSettings) -> i64 {
        (self.get)(settings)
    }

    /// The word of a raw value; `None` for a number.
    pub fn word_of(&self, raw: i64) -> Option<&'static str> {
        match self.form {
            Form::Words(words) => words.get(usize::try_from(raw).ok()?).copied(),
            Form::Steps(_) => None,
        }
    }

    /// The raw value of a word; `None` if the field has no such word.
    pub fn raw_of_word(&self, word: &str) -> Option<i64> {
        let Form::Words(words) = self.form else { return None };
        words.iter().position(|known| *known == word).map(|index| index as i64)
    }

    /// The number of units of a raw value; the raw value itself for a word.
    pub fn number_of(&self, raw: i64) -> f64 {
        match self.form {
            Form::Steps(steps) => raw as f64 / f64::from(steps),
            Form::Words(_) => raw as f64,
        }
    }

    /// The nearest raw value of a number of units; `None` if the number is out of [range](Self::range).
    pub fn raw_of(&self, number: f64) -> Option<i64> {
        let Form::Steps(steps) = self.form else { return None };
        let raw = libm::round(number * f64::from(steps));
        (self.least_given() as f64..=self.most as f64).contains(&raw).then_some(raw as i64)
    }

    /// The least and the largest number of units in a document.
    pub fn range(&self) -> (f64, f64) {
        (self.number_of(self.least_given()), self.number_of(self.most))
    }

    fn least_given(&self) -> i64 {
        if self.optional { self.least.max(1) } else { self.least }
    }

    fn read(&self, fields: &mut Fields<'_>) -> Result<i64, Nack> {
        let index = fields.index();
        let raw = match self.wire {
            Wire::U8 => u8::read(fields)?.into(),
            Wire::U16 => u16::read(fields)?.into(),
            Wire::U32 => u32::read(fields)?.into(),
            Wire::I32 => i32::read(fields)?.into(),
        };
        if (self.least..=self.most).contains(&raw) { Ok(raw) } else { Err(Nack::parameter(index)) }
    }

    /// Appends a raw value, which is in range.
    fn write(&self, raw: i64, payload: &mut Payload) {
        match self.wire {
            Wire::U8 => (raw as u8).write(payload),
            Wire::U16 => (raw as u16).write(payload),
            Wire::U32 => (raw as u32).write(payload),
            Wire::I32 => (raw as i32).write(payload),
        }
    }
}

/// The most fields of a group.
const MOST_FIELDS: usize = 6;

/// Values of all fields of one group, each in the range of its field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Values {
    group: Group,
    /// Raw values in the order of the fields; 0 behind the last field.
    raw: [i64; MOST_FIELDS],
}

impl Values {
    /// The raw values that `value` returns for the fields.
    ///
    /// # Errors
    /// The first error of `value`.
    pub fn collect<E>(group: Group, mut value: impl FnMut(&Field) -> Result<i64, E>) -> Result<Self, E> {
        let mut raw = [0; MOST_FIELDS];
        for (slot, field) in raw.iter_mut().zip(group.fields()) {
            *slot = value(field)?;
        }
        Ok(Self { group, raw })
    }

    /// The values in these settings.
    pub fn of(group: Group, settings: &MotorSettings) -> Self {
        let Ok(values) = Self::collect(group, |field| Ok::<_, Infallible>(field.get(settings)));
        values
    }

    /// Reads the values of a group, behind the fields that name the motor and the loop.
    ///
    /// # Errors
    /// The number of the first field that is missing or out of range.
    pub fn read(group: Group, fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Self::collect(group, |field| field.read(fields))
    }

    /// Appends the values.
    pub fn write(&self, payload: &mut Payload) {
        for (field, raw) in self.group.fields().iter().zip(self.raw) {
            field.write(raw, payload);
        }
    }

    /// The group that the values belong to.
    pub const fn group(&self) -> Group {
        self.group
    }

    /// The settings with these values.
    ///
    /// # Errors
    /// The number of a field that does not go with the other fields: linear current without a resistance, or a thermal limit
    /// without time constants.
    pub fn put(&self, settings: &MotorSettings) -> Result<MotorSettings, Nack> {
        let mut new = *settings;
        if self.group == Group::SetUp {
            let Settings { winding, bridge, scheme, zero_power, on_fault, thermal, .. } = settings.motor;
            new.motor =
                Settings { bridge, zero_power, on_fault, thermal, ..Settings::for_scheme(winding, scheme) };
        }
        let first = if self.group.loop_of().is_some() { 2 } else { 1 };
        for ((index, field), value) in (first..).zip(self.group.fields()).zip(self.raw) {
            (field.put)(&mut new, value).ok_or(Nack::parameter(index))?;
        }
        if let (Group::SetUp, [_, 0, ..]) = (self.group, self.raw) {
            if new.motor.duty == DutyRule::LinearCurrent {
                return Err(Nack::parameter(2));
            }
            new.motor.winding = Winding { emf: new.motor.winding.emf, ..settings.motor.winding };
        }
        Ok(new)
    }
}

type Get = fn(&MotorSettings) -> i64;
type Put = fn(&mut MotorSettings, i64) -> Option<()>;

const SET_UP: &[Field] = &[
    Field::number(
        "emf_mv_s_per_count",
        Wire::I32,
        1 << 20,
        |settings| settings.motor.winding.emf.to_bits().into(),
        |settings, bits| {
            settings.motor.winding.emf = EmfConstant::from_bits(i32::try_from(bits).ok()?).ok()?;
            Some(())
        },
    )
    .within(1, (1 << 25) - 1),
    Field::number(
        "resistance_ohm",
        Wire::U16,
        1_000,
        |settings| settings.motor.winding.resistance.as_milliohms().into(),
        |settings, milliohms| {
            // 0 keeps the winding: `Values::put`.
            if let Ok(resistance) = Resistance::from_milliohms(u16::try_from(milliohms).ok()?) {
                settings.motor.winding.resistance = resistance;
            }
            Some(())
        },
    )
    .or_none(),
    Field::number(
        "inductance_mh",
        Wire::U16,
        1_000,
        |settings| settings.motor.winding.inductance.map_or(0, Inductance::as_microhenries).into(),
        |settings, microhenries| {
            settings.motor.winding.inductance =
                Inductance::from_microhenries(u16::try_from(microhenries).ok()?).ok();
            Some(())
        },
    )
    .or_none(),
    Field::word(
        "scheme",
        &["none", "A", "B", "C", "D auto", "D"],
        |settings| match settings.motor.scheme {
            Scheme::ForwardReverse => 0,
            Scheme::A => 1,
            Scheme::B => 2,
            Scheme::C => 3,
            Scheme::D(Blend::Automatic) => 4,
            Scheme::D(Blend::Fixed(_)) => 5,
        },
        |settings, code| {
            settings.motor.scheme = match code {
                0 => Scheme::ForwardReverse,
                1 => Scheme::A,
                2 => Scheme::B,
                3 => Scheme::C,
                4 => Scheme::D(Blend::Automatic),
                _ => Scheme::D(Blend::Fixed(BlendFraction::ZERO)),
            };
            Some(())
        },
    ),
    Field::number(
        "blend",
        Wire::U16,
        1 << 16,
        |settings| match settings.motor.scheme {
            // 16 bits end just below 1, which is Scheme C.
            Scheme::D(Blend::Fixed(blend)) => blend.to_bits().min(u16::MAX.into()).into(),
            _ => 0,
        },
        |settings, bits| {
            if let Scheme::D(Blend::Fixed(blend)) = &mut settings.motor.scheme {
                *blend = BlendFraction::from_bits(u32::try_from(bits).ok()?).ok()?;
            }
            Some(())
        },
    ),
    Field::word(
        "duty",
        &["linear-duty", "linear-current"],
        |settings| (settings.motor.duty == DutyRule::LinearCurrent).into(),
        |settings, code| {
            settings.motor.duty = if code == 0 { DutyRule::LinearDuty } else { DutyRule::LinearCurrent };
            Some(())
        },
    ),
];

/// A time of [`Timing`] in whole units.
macro_rules! time {
    ($name:literal, $field:ident) => {
        Field::number(
            $name,
            Wire::U16,
            1,
            |settings| settings.motor.bridge.timing().$field.into(),
            |settings, time| {
                let timing = settings.motor.bridge.timing();
                let timing = Timing { $field: u16::try_from(time).ok()?, ..timing };
                settings.motor.bridge = settings.motor.bridge.with_timing(timing);
                Some(())
            },
        )
    };
}

const TIMING: &[Field] = &[
    time!("bridge.least_off_ns", least_off_ns),
    time!("bridge.least_on_ns", least_on_ns),
    time!("bridge.turn_on_ns", turn_on_ns),
    time!("bridge.turn_off_ns", turn_off_ns),
    time!("bridge.change_us", change_us),
];

const PROTECTION: &[Field] = &[
    Field::word(
        "on_fault",
        &["coast", "brake"],
        |settings| (settings.motor.on_fault == OnFault::Brake).into(),
        |settings, code| {
            settings.motor.on_fault = if code == 0 { OnFault::Coast } else { OnFault::Brake };
            Some(())
        },
    ),
    Field::number(
        "thermal.continuous_current_ma",
        Wire::U16,
        1,
        |settings| settings.motor.thermal.map_or(0, |limit| limit.continuous_ma()).into(),
        |settings, ma| {
            let usual = (ThermalLimit::USUAL_WINDING_S, ThermalLimit::USUAL_CASE_S);
            settings.motor.thermal = ThermalLimit::new(u16::try_from(ma).ok()?, usual.0, usual.1).ok();
            Some(())
        },
    )
    .or_none(),
    Field::number(
        "thermal.winding_s",
        Wire::U16,
        1,
        |settings| settings.motor.thermal.map_or(0, |limit| limit.winding_s()).into(),
        |settings, winding_s| {
            if let Some(limit) = &mut settings.motor.thermal {
                let winding_s = u16::try_from(winding_s).ok()?;
                *limit = ThermalLimit::new(limit.continuous_ma(), winding_s, limit.case_s()).ok()?;
            }
            Some(())
        },
    )
    .or_none(),
    Field::number(
        "thermal.case_s",
        Wire::U16,
        1,
        |settings| settings.motor.thermal.map_or(0, |limit| limit.case_s()).into(),
        |settings, case_s| {
            if let Some(limit) = &mut settings.motor.thermal {
                let case_s = u16::try_from(case_s).ok()?;
                *limit = ThermalLimit::new(limit.continuous_ma(), limit.winding_s(), case_s).ok()?;
            }
            Some(())
        },
    )
    .or_none(),
];

const MOTION: &[Field] = &[
    Field::number(
        "dynamics.acceleration_cps2_per_v",
        Wire::U32,
        1 << 8,
        |settings| settings.motor.dynamics.map_or(0, |dynamics| dynamics.gain.to_bits()).into(),
        |settings, bits| {
            let gain = AccelerationPerVolt::from_bits(u32::try_from(bits).ok()?).ok();
            let (decay, friction) = (DecayRate::from_bits(0), Millivolts::new(0));
            settings.motor.dynamics = gain.map(|gain| Dynamics { gain, decay, friction });
            Some(())
        },
    )
    .or_none(),
    Field::number(
        "dynamics.decay_per_s",
        Wire::U32,
        1 << 16,
        |settings| settings.motor.dynamics.map_or(0, |dynamics| dynamics.decay.to_bits()).into(),
        |settings, bits| {
            if let Some(dynamics) = &mut settings.motor.dynamics {
                dynamics.decay = DecayRate::from_bits(u32::try_from(bits).ok()?);
            }
            Some(())
        },
    ),
    Field::number(
        "dynamics.friction_mv",
        Wire::U16,
        1,
        |settings| settings.motor.dynamics.map_or(0, |dynamics| dynamics.friction.get()).into(),
        |settings, friction| {
            if let Some(dynamics) = &mut settings.motor.dynamics {
                dynamics.friction = Millivolts::new(u16::try_from(friction).ok()?);
            }
            Some(())
        },
    ),
    Field::number(
        "acceleration_limit_cps2",
        Wire::U32,
        1,
        |settings| settings.motor.acceleration.map_or(0, Acceleration::get).into(),
        |settings, limit| {
            settings.motor.acceleration = Acceleration::new(u32::try_from(limit).ok()?).ok();
            Some(())
        },
    )
    .or_none(),
];

const MODE: &[Field] = &[
    Field::word(
        "mode",
        &["power", "velocity", "position"],
        |settings| match settings.mode {
            RunMode::Power => 0,
            RunMode::Velocity => 1,
            RunMode::Position => 2,
        },
        |settings, code| {
            settings.mode = match code {
                0 => RunMode::Power,
                1 => RunMode::Velocity,
                _ => RunMode::Position,
            };
            Some(())
        },
    ),
    // Hosts send any byte that is not 0 for a motor that floats.
    Field::word(
        "at_zero_power",
        &["brake", "float"],
        |settings| (settings.motor.zero_power == ZeroPower::Float).into(),
        |settings, code| {
            settings.motor.zero_power = if code == 0 { ZeroPower::Brake } else { ZeroPower::Float };
            Some(())
        },
    )
    .within(0, 255),
];

const CURRENT_ALERT: &[Field] = &[Field::number(
    "current_alert_ma",
    Wire::U16,
    1,
    |settings| settings.current_alert_ma.into(),
    |settings, ma| {
        settings.current_alert_ma = u16::try_from(ma).ok()?;
        Some(())
    },
)];

/// A coefficient of a loop.
macro_rules! coefficient {
    ($name:literal, $loop:ident, $field:ident) => {
        Field::number(
            $name,
            Wire::I32,
            1 << 16,
            |settings| settings.coefficients(Loop::$loop).$field.to_bits().into(),
            |settings, bits| {
                let $field = Coefficient::from_bits(i32::try_from(bits).ok()?);
                let before = settings.coefficients(Loop::$loop);
                settings.set_coefficients(Loop::$loop, Coefficients { $field, ..before });
                Some(())
            },
        )
    };
}

/// How a host means the coefficients of a loop.
macro_rules! algorithm {
    ($name:literal, $loop:ident) => {
        Field::word(
            $name,
            &["pid", "pidf"],
            |settings| (settings.coefficients(Loop::$loop).algorithm == Algorithm::Pidf).into(),
            |settings, code| {
                let algorithm = if code == 0 { Algorithm::Legacy } else { Algorithm::Pidf };
                let before = settings.coefficients(Loop::$loop);
                settings.set_coefficients(Loop::$loop, Coefficients { algorithm, ..before });
                Some(())
            },
        )
    };
}

const VELOCITY_LOOP: &[Field] = &[
    coefficient!("velocity_loop.p", Velocity, p),
    coefficient!("velocity_loop.i", Velocity, i),
    coefficient!("velocity_loop.d", Velocity, d),
    coefficient!("velocity_loop.f", Velocity, f),
    algorithm!("velocity_loop.terms", Velocity),
];

const POSITION_LOOP: &[Field] = &[
    coefficient!("position_loop.p", Position, p),
    coefficient!("position_loop.i", Position, i),
    coefficient!("position_loop.d", Position, d),
    coefficient!("position_loop.f", Position, f),
    algorithm!("position_loop.terms", Position),
];
