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
//! Fields stand in groups, since one request sets all fields of a group. Some groups are functions of the extension, the
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
use crate::protocol::motor::{Algorithm, ChannelMode, Coefficients, Loop, RunMode};
use crate::protocol::payload::{Field as _, Fields, Payload};
use crate::protocol::{Nack, requests};
use crate::regulator::{self, Dynamics};
use crate::units::{
    Acceleration, AccelerationPerVolt, Coefficient, DecayRate, EmfConstant, Inductance, Millivolts, Period,
    Resistance,
};
use core::convert::Infallible;
use core::num::NonZeroU16;

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
        ChannelMode { mode: self.mode, floats: self.motor.zero_power == ZeroPower::Float }
    }

    /// Sets what [`channel_mode`](Self::channel_mode) returns.
    pub const fn set_channel_mode(&mut self, ChannelMode { mode, floats }: ChannelMode) {
        self.mode = mode;
        self.motor.zero_power = if floats { ZeroPower::Float } else { ZeroPower::Brake };
    }

    /// Coefficients of a loop: a host's coefficients, else the guess for a motor without a known load.
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
    /// The largest current of the motor.
    CurrentLimit,
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
    pub const EACH: [Self; 9] = [
        Self::SetUp,
        Self::Timing,
        Self::Protection,
        Self::CurrentLimit,
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
            Self::CurrentLimit => FIRST_FUNCTION + 28,
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

    /// False for coefficients and a current limit that no host has set. A hub stores only groups that are in use.
    pub const fn in_use(self, settings: &MotorSettings) -> bool {
        match self {
            Self::VelocityLoop | Self::PositionLoop => settings.motor.coefficients.is_some(),
            Self::CurrentLimit => settings.motor.current_limit.is_some(),
            _ => true,
        }
    }

    /// The fields in their order.
    pub const fn fields(self) -> &'static [Field] {
        match self {
            Self::SetUp => SET_UP,
            Self::Timing => TIMING,
            Self::Protection => PROTECTION,
            Self::CurrentLimit => CURRENT_LIMIT,
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
    /// Bytes of a raw value.
    size: usize,
    /// True if the raw value may be below 0.
    signed: bool,
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

impl Field {
    /// The field with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Group::EACH.iter().flat_map(|group| group.fields()).find(|field| field.name == name)
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
        let bytes = fields.slice(self.size)?;
        let raw = bytes.iter().rev().fold(0, |raw: i64, byte| raw << 8 | i64::from(*byte));
        let raw = if self.signed { i64::from(raw as i32) } else { raw };
        if (self.least..=self.most).contains(&raw) { Ok(raw) } else { Err(Nack::parameter(index)) }
    }

    /// Appends a raw value, which is in range.
    fn write(&self, raw: i64, payload: &mut Payload) {
        for byte in raw.to_le_bytes().iter().take(self.size) {
            byte.write(payload);
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
            let Settings { winding, bridge, scheme, zero_power, on_fault, thermal, current_limit, .. } =
                settings.motor;
            let unknown = Settings::for_scheme(winding, scheme);
            new.motor = Settings { bridge, zero_power, on_fault, thermal, current_limit, ..unknown };
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

/// Defines fields. A number states its integer type on the line, its steps in a unit, its value in the settings, and how the
/// settings take a value; `limits` replaces the limits of the type. Words state their values and the place in the settings.
macro_rules! fields {
    (@ {
        $name:literal, $type:ident / $steps:expr $(, limits $least:literal to $most:expr)? $(, optional $optional:literal)?,
        |$settings:ident| $get:expr, |$into:ident, $value:ident| $put:expr
    }) => {
        Field {
            name: $name,
            form: Form::Steps($steps),
            optional: false $(|| $optional)?,
            size: size_of::<$type>(),
            signed: $type::MIN != 0,
            least: first(&[$($least,)? $type::MIN as i64]),
            most: first(&[$($most,)? $type::MAX as i64]),
            get: |$settings| i64::from($get),
            put: |$into, value| {
                let $value = $type::try_from(value).ok()?;
                $put;
                Some(())
            },
        }
    };
    (@ { $name:literal, $($word:literal $value:expr),+; $($place:ident).+ $(, up to $most:literal)? }) => {
        Field {
            name: $name,
            form: Form::Words(&[$($word),+]),
            optional: false,
            size: 1,
            signed: false,
            least: 0,
            most: first(&[$($most,)? [$($word),+].len() as i64 - 1]),
            get: |settings| {
                let mut values = [$($value),+].into_iter();
                // The last word also stands for all values that are not listed.
                let last = values.len() as i64 - 1;
                values.position(|value| value == settings.$($place).+).map_or(last, |code| code as i64)
            },
            put: |settings, code| {
                let values = [$($value),+];
                settings.$($place).+ = *values.get(usize::try_from(code).ok()?).or(values.last())?;
                Some(())
            },
        }
    };
    ($($fields:tt)*) => { &[$(fields!(@ $fields)),*] };
}

/// The first of some limits: the limit that a field states, else the limit of its integer type.
const fn first(limits: &[i64]) -> i64 {
    match limits {
        [first, ..] => *first,
        [] => 0,
    }
}

const SET_UP: &[Field] = fields! {
    {
        "emf_mv_s_per_count", i32 / 1 << 20, limits 1 to (1 << 25) - 1,
        |settings| settings.motor.winding.emf.to_bits(),
        |settings, bits| settings.motor.winding.emf = EmfConstant::from_bits(bits).ok()?
    }
    {
        // 0 keeps the winding: `Values::put`.
        "resistance_ohm", u16 / 1_000, optional true,
        |settings| settings.motor.winding.resistance.as_milliohms(),
        |settings, milliohms| if let Ok(resistance) = Resistance::from_milliohms(milliohms) {
            settings.motor.winding.resistance = resistance;
        }
    }
    {
        "inductance_mh", u16 / 1_000, optional true,
        |settings| settings.motor.winding.inductance.map_or(0, Inductance::as_microhenries),
        |settings, microhenries| {
            settings.motor.winding.inductance = Inductance::from_microhenries(microhenries).ok();
        }
    }
    {
        "scheme", "none" Scheme::ForwardReverse, "A" Scheme::A, "B" Scheme::B, "C" Scheme::C,
        "D auto" Scheme::D(Blend::Automatic), "D" Scheme::D(Blend::Fixed(BlendFraction::ZERO));
        motor.scheme
    }
    {
        // 16 bits end just below 1, which is Scheme C.
        "blend", u16 / 1 << 16,
        |settings| match settings.motor.scheme {
            Scheme::D(Blend::Fixed(blend)) => u16::try_from(blend.to_bits()).unwrap_or(u16::MAX),
            _ => 0,
        },
        |settings, bits| if let Scheme::D(Blend::Fixed(blend)) = &mut settings.motor.scheme {
            *blend = BlendFraction::from_bits(bits.into()).ok()?;
        }
    }
    { "duty", "linear-duty" DutyRule::LinearDuty, "linear-current" DutyRule::LinearCurrent; motor.duty }
};

const TIMING: &[Field] = fields! {
    {
        "bridge.least_off_ns", u16 / 1, |settings| settings.motor.bridge.timing().least_off_ns,
        |settings, least_off_ns| set_timing(settings, |timing| Timing { least_off_ns, ..timing })
    }
    {
        "bridge.least_on_ns", u16 / 1, |settings| settings.motor.bridge.timing().least_on_ns,
        |settings, least_on_ns| set_timing(settings, |timing| Timing { least_on_ns, ..timing })
    }
    {
        "bridge.turn_on_ns", u16 / 1, |settings| settings.motor.bridge.timing().turn_on_ns,
        |settings, turn_on_ns| set_timing(settings, |timing| Timing { turn_on_ns, ..timing })
    }
    {
        "bridge.turn_off_ns", u16 / 1, |settings| settings.motor.bridge.timing().turn_off_ns,
        |settings, turn_off_ns| set_timing(settings, |timing| Timing { turn_off_ns, ..timing })
    }
    {
        "bridge.change_us", u16 / 1, |settings| settings.motor.bridge.timing().change_us,
        |settings, change_us| set_timing(settings, |timing| Timing { change_us, ..timing })
    }
};

fn set_timing(settings: &mut MotorSettings, change: impl FnOnce(Timing) -> Timing) {
    let bridge = settings.motor.bridge;
    settings.motor.bridge = bridge.with_timing(change(bridge.timing()));
}

const PROTECTION: &[Field] = fields! {
    { "on_fault", "coast" OnFault::Coast, "brake" OnFault::Brake; motor.on_fault }
    {
        "thermal.continuous_current_ma", u16 / 1, optional true,
        |settings| settings.motor.thermal.map_or(0, |limit| limit.continuous_ma()),
        |settings, ma| settings.motor.thermal =
            ThermalLimit::new(ma, ThermalLimit::USUAL_WINDING_S, ThermalLimit::USUAL_CASE_S).ok()
    }
    {
        "thermal.winding_s", u16 / 1, optional true,
        |settings| settings.motor.thermal.map_or(0, |limit| limit.winding_s()),
        |settings, winding_s| if let Some(limit) = &mut settings.motor.thermal {
            *limit = ThermalLimit::new(limit.continuous_ma(), winding_s, limit.case_s()).ok()?;
        }
    }
    {
        "thermal.case_s", u16 / 1, optional true,
        |settings| settings.motor.thermal.map_or(0, |limit| limit.case_s()),
        |settings, case_s| if let Some(limit) = &mut settings.motor.thermal {
            *limit = ThermalLimit::new(limit.continuous_ma(), limit.winding_s(), case_s).ok()?;
        }
    }
};

const CURRENT_LIMIT: &[Field] = fields! {
    {
        "current_limit_ma", u16 / 1, optional true,
        |settings| settings.motor.current_limit.map_or(0, NonZeroU16::get),
        |settings, ma| settings.motor.current_limit = NonZeroU16::new(ma)
    }
};

const MOTION: &[Field] = fields! {
    {
        "dynamics.acceleration_cps2_per_v", u32 / 1 << 8, optional true,
        |settings| settings.motor.dynamics.map_or(0, |dynamics| dynamics.gain.to_bits()),
        |settings, bits| {
            let (decay, friction) = (DecayRate::from_bits(0), Millivolts::new(0));
            let gain = AccelerationPerVolt::from_bits(bits).ok();
            settings.motor.dynamics = gain.map(|gain| Dynamics { gain, decay, friction });
        }
    }
    {
        "dynamics.decay_per_s", u32 / 1 << 16,
        |settings| settings.motor.dynamics.map_or(0, |dynamics| dynamics.decay.to_bits()),
        |settings, bits| if let Some(dynamics) = &mut settings.motor.dynamics {
            dynamics.decay = DecayRate::from_bits(bits);
        }
    }
    {
        "dynamics.friction_mv", u16 / 1,
        |settings| settings.motor.dynamics.map_or(0, |dynamics| dynamics.friction.get()),
        |settings, friction| if let Some(dynamics) = &mut settings.motor.dynamics {
            dynamics.friction = Millivolts::new(friction);
        }
    }
    {
        "acceleration_limit_cps2", u32 / 1, optional true,
        |settings| settings.motor.acceleration.map_or(0, Acceleration::get),
        |settings, limit| settings.motor.acceleration = Acceleration::new(limit).ok()
    }
};

const MODE: &[Field] = fields! {
    { "mode", "power" RunMode::Power, "velocity" RunMode::Velocity, "position" RunMode::Position; mode }
    // Hosts send any byte but 0 for a motor that floats.
    { "at_zero_power", "brake" ZeroPower::Brake, "float" ZeroPower::Float; motor.zero_power, up to 255 }
};

const CURRENT_ALERT: &[Field] = fields! {
    {
        "current_alert_ma", u16 / 1,
        |settings| settings.current_alert_ma, |settings, ma| settings.current_alert_ma = ma
    }
};

/// The fields of a loop's coefficients.
macro_rules! coefficients {
    ($loop:ident, $algorithm:ident, $($name:literal $field:ident),+; $terms:literal) => {
        fields! {
            $({
                $name, i32 / 1 << 16,
                |settings| settings.coefficients(Loop::$loop).$field.to_bits(),
                |settings, bits| {
                    let before = settings.coefficients(Loop::$loop);
                    let $field = Coefficient::from_bits(bits);
                    settings.set_coefficients(Loop::$loop, Coefficients { $field, ..before });
                }
            })+
            { $terms, "pid" Algorithm::Legacy, "pidf" Algorithm::Pidf; $algorithm }
        }
    };
}

const VELOCITY_LOOP: &[Field] = coefficients!(
    Velocity, velocity_algorithm, "velocity_loop.p" p, "velocity_loop.i" i, "velocity_loop.d" d,
    "velocity_loop.f" f; "velocity_loop.terms"
);

const POSITION_LOOP: &[Field] = coefficients!(
    Position, position_algorithm, "position_loop.p" p, "position_loop.i" i, "position_loop.d" d,
    "position_loop.f" f; "position_loop.terms"
);
