//! The settings of one motor, in one table of fields. Packets, stored records, settings files (TOML, JSON) and options
//! of programs follow from this table.
//!
//! * A *field* is one setting. Its *raw value* is the integer that stands for the setting in a packet.
//! * A *group* is a list of fields that one request sets together. Groups of motors ([`crate::group`]) have nothing to
//!   do with groups of fields.
//! * [`Values`] are the raw values of all fields of one group.
//!
//! ```text
//!                  Values::of              Values::write
//! MotorSettings ----------------> Values -----------------> payload of a packet, or of a stored entry
//!               <----------------        <-----------------
//!                Values::apply_to          Values::read
//! ```
//!
//! The fields of a group are applied in the order of the table, and a field may depend on fields before it. For
//! example, `blend` has an effect only if `scheme` is `D`.
//!
//! A later version may add fields at the end of a group. Such a field states the version that added it. Requests of
//! older hosts, stored records, and settings files of older versions may lack the field:
//!
//! | a field is missing in | value of the setting |
//! |---|---|
//! | a host's request | the present value |
//! | a stored entry | the value that the firmware was built with |
//! | a hub's answer, or a settings file | the default: the value in [`Settings::for_scheme`] |
//!
//! The extension has requests for some groups, and REV's protocol has requests for the others.
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
use crate::motion::Pidf;
use crate::motor::{OnFault, Settings, ThermalLimit, ZeroPower};
use crate::protocol::motor::{ChannelMode, Loop, LoopCoefficients, RunMode, Terms};
use crate::protocol::payload::{Field as _, Fields, Payload};
use crate::protocol::{Nack, requests};
use crate::regulator::{self, Dynamics};
use crate::units::{
    Acceleration, AccelerationPerVolt, Coefficient, DecayRate, EmfConstant, Inductance, Millivolts,
    Resistance,
};
use core::convert::Infallible;
use core::num::NonZeroU16;

/// All settings of one motor that a host can change and a hub can store.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorSettings {
    /// Settings of the motor itself.
    pub motor: Settings,
    /// REV's mode of the motor: the kind of its set-point.
    pub mode: RunMode,
    /// Current above which the hub reports an alert, in milliamperes; 0 for no alert.
    pub current_alert_ma: u16,
    /// Terms (PID or PIDF) that a host has sent with the coefficients of the velocity loop. Hosts read the terms back;
    /// regulation does not use the terms.
    pub velocity_terms: Terms,
    /// Terms (PID or PIDF) that a host has sent with the coefficients of the position loop. Hosts read the terms back;
    /// regulation does not use the terms.
    pub position_terms: Terms,
}

impl MotorSettings {
    /// Creates the settings that a motor has before a host changes a setting: mode power, and no current alert.
    pub const fn new(motor: Settings) -> Self {
        let (velocity_terms, position_terms) = (Terms::Pidf, Terms::Pidf);
        Self { motor, mode: RunMode::Power, current_alert_ma: 0, velocity_terms, position_terms }
    }

    /// Returns REV's mode of the motor, with what the motor does at zero power.
    pub fn channel_mode(&self) -> ChannelMode {
        ChannelMode { mode: self.mode, floats: self.motor.zero_power == ZeroPower::Float }
    }

    /// Sets REV's mode of the motor, and what the motor does at zero power.
    pub const fn set_channel_mode(&mut self, ChannelMode { mode, floats }: ChannelMode) {
        self.mode = mode;
        self.motor.zero_power = if floats { ZeroPower::Float } else { ZeroPower::Brake };
    }

    /// Returns the coefficients of a loop. If no coefficients are configured, they are suggested from the back EMF.
    pub fn coefficients(&self, of: Loop) -> LoopCoefficients {
        let both = self.both_loops();
        let (Pidf { p, i, d, f }, terms) = match of {
            Loop::Velocity => (both.velocity, self.velocity_terms),
            Loop::Position => (both.position, self.position_terms),
        };
        LoopCoefficients { p, i, d, f, terms }
    }

    /// Sets the coefficients of one loop. PID with the coefficients of both loops then regulates the motor.
    pub fn set_coefficients(&mut self, of: Loop, coefficients: LoopCoefficients) {
        let LoopCoefficients { p, i, d, f, terms } = coefficients;
        let (mut both, pidf) = (self.both_loops(), Pidf { p, i, d, f });
        match of {
            Loop::Velocity => (both.velocity, self.velocity_terms) = (pidf, terms),
            Loop::Position => (both.position, self.position_terms) = (pidf, terms),
        }
        self.motor.coefficients = Some(both);
    }

    /// Returns the configured coefficients of both loops. If no coefficients are configured, returns suggested
    /// coefficients.
    fn both_loops(&self) -> regulator::Coefficients {
        let Settings { winding, coefficients, .. } = self.motor;
        coefficients.unwrap_or_else(|| regulator::Coefficients::suggested(winding.emf))
    }
}

/// A group of fields that one request sets together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Group {
    /// Constants of the connected motor, its scheme and its duty rule.
    ///
    /// Setting this group deletes dynamics, acceleration limit and coefficients, because they belong to the motor that
    /// was connected before. A resistance of 0 keeps the present resistance and inductance.
    SetUp,
    /// Switching times of the motor's bridge.
    Timing,
    /// Behaviour at a fault, and the thermal limit.
    Protection,
    /// Current limit of the motor.
    CurrentLimit,
    /// Dynamics of the motor with its load, and the acceleration limit.
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
    /// All groups. `SetUp` is first, because it deletes settings of other groups.
    pub const ALL: [Self; 9] = [
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

    /// Iterates over the groups that have no coefficients of a control loop, in the order of [`ALL`](Self::ALL).
    pub fn without_coefficients() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|group| group.loop_of().is_none())
    }

    /// Returns the packet type of the request that sets the group, on hubs of this project. An entry of a stored
    /// record has the same type.
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

    /// Returns the packet type of the request that asks for the group, on hubs of this project.
    pub const fn get_id(self) -> u16 {
        match self {
            Self::VelocityLoop | Self::PositionLoop => requests::FIRST_FUNCTION + 53,
            _ => self.set_id() + 1,
        }
    }

    /// Returns the loop whose coefficients are in the group. `None` for a group without coefficients.
    pub const fn loop_of(self) -> Option<Loop> {
        match self {
            Self::VelocityLoop => Some(Loop::Velocity),
            Self::PositionLoop => Some(Loop::Position),
            _ => None,
        }
    }

    /// Appends the fields before the values of the group: the number of the motor and, for coefficients, the code of
    /// the loop.
    pub fn write_name(self, motor: u8, payload: &mut Payload) {
        motor.write(payload);
        if let Some(of) = self.loop_of() {
            of.write(payload);
        }
    }

    /// True if the hub must store the group. False for coefficients that are not configured, and for a group in which
    /// no field is configured. A field with another meaning of 0 than [`Zero::NotConfigured`] is always configured.
    pub fn is_configured(self, settings: &MotorSettings) -> bool {
        if self.loop_of().is_some() {
            return settings.motor.coefficients.is_some();
        }
        self.fields().iter().any(|field| field.zero != Zero::NotConfigured || field.get(settings) != 0)
    }

    /// Returns the fields of the group, in the order in which they are sent and applied.
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

/// One field of the table.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// Key in a settings file. If the field has a unit, the key ends with the unit. A key with a dot belongs to a table
    /// of the file.
    pub name: &'static str,
    /// Meaning of the raw values.
    pub form: Form,
    /// Meaning of the raw value 0.
    pub zero: Zero,
    /// Version that added the field to its group. `None` if the field is as old as its group.
    pub since: Option<&'static str>,
    /// Help of the option of `client setup` that sets the field. `None` if the field has no option of its own. Images
    /// of a board lack the help, to save flash.
    #[cfg(not(target_os = "none"))]
    pub option: Option<&'static str>,
    /// Size of the raw value in a packet, in bytes.
    pub size: usize,
    /// True if the raw value in a packet is signed.
    pub signed: bool,
    /// Smallest raw value in a packet.
    least: i64,
    /// Largest raw value in a packet.
    most: i64,
    /// Returns the raw value in these settings.
    get: fn(&MotorSettings) -> i64,
    /// Sets a raw value that is in range. `None` if the settings cannot have the value.
    set: fn(&mut MotorSettings, i64) -> Option<()>,
}

/// Meaning of a field's raw value 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Zero {
    /// The number 0 or, for a choice, the first word.
    Value,
    /// The setting is not configured. A settings file then lacks the key. If the field is the first field of a table of
    /// the file, the file lacks the whole table.
    NotConfigured,
    /// The present setting is kept. A hub never reports this value, and a settings file cannot have it.
    Keeps,
}

/// The meaning of a field's raw values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// A number. One unit is this many steps of the raw value.
    Steps(u32),
    /// A choice. The raw value is the index of one of these words.
    Words(&'static [&'static str]),
}

impl Field {
    /// Finds the field with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Group::ALL.iter().flat_map(|group| group.fields()).find(|field| field.name == name)
    }

    /// Returns the raw value of the field in these settings.
    pub fn get(&self, settings: &MotorSettings) -> i64 {
        (self.get)(settings)
    }

    /// Sets a raw value that is in range. `None` if the settings cannot have the value.
    pub fn set(&self, settings: &mut MotorSettings, raw: i64) -> Option<()> {
        (self.set)(settings, raw)
    }

    /// Converts a raw value to its word. `None` if the field is a number, or if the raw value is beyond the last word.
    pub fn word_of(&self, raw: i64) -> Option<&'static str> {
        match self.form {
            Form::Words(words) => words.get(usize::try_from(raw).ok()?).copied(),
            Form::Steps(_) => None,
        }
    }

    /// Converts a word to its raw value. `None` if the field does not have this word.
    pub fn raw_of_word(&self, word: &str) -> Option<i64> {
        let Form::Words(words) = self.form else { return None };
        words.iter().position(|known| *known == word).map(|index| index as i64)
    }

    /// Converts a raw value to a number of units. For a choice the number is the raw value.
    pub fn number_of(&self, raw: i64) -> f64 {
        match self.form {
            Form::Steps(steps) => raw as f64 / f64::from(steps),
            Form::Words(_) => raw as f64,
        }
    }

    /// Converts a number of units to the nearest raw value. `None` if the number is out of [range](Self::range), or if
    /// the field has words.
    pub fn raw_of(&self, number: f64) -> Option<i64> {
        let Form::Steps(steps) = self.form else { return None };
        let raw = libm::round(number * f64::from(steps));
        (self.least_in_file() as f64..=self.most as f64).contains(&raw).then_some(raw as i64)
    }

    /// Returns the smallest and the largest number of units in a settings file.
    pub fn range(&self) -> (f64, f64) {
        (self.number_of(self.least_in_file()), self.number_of(self.most))
    }

    /// Returns the smallest raw value in a settings file. A file can have 0 only for a field with [`Zero::Value`].
    fn least_in_file(&self) -> i64 {
        if self.zero == Zero::Value { self.least } else { self.least.max(1) }
    }

    /// Reads a raw value from a packet. `None` if the packet ends before a field that a later version has added.
    ///
    /// # Errors
    /// Returns [`Nack::parameter`] if any other field is missing, or if the field is out of range.
    fn read(&self, fields: &mut Fields<'_>) -> Result<Option<i64>, Nack> {
        if self.since.is_some() && fields.is_empty() {
            return Ok(None);
        }
        let index = fields.index();
        let bytes = fields.slice(self.size)?;
        let raw = bytes.iter().rev().fold(0, |raw: i64, byte| raw << 8 | i64::from(*byte));
        // The shifts extend the sign to 64 bits.
        let unused_bits = if self.signed { i64::BITS - 8 * self.size as u32 } else { 0 };
        let raw = raw << unused_bits >> unused_bits;
        if (self.least..=self.most).contains(&raw) { Ok(Some(raw)) } else { Err(Nack::parameter(index)) }
    }

    /// Appends a raw value to a packet. The value must be in range.
    fn write(&self, raw: i64, payload: &mut Payload) {
        for byte in raw.to_le_bytes().iter().take(self.size) {
            byte.write(payload);
        }
    }
}

/// Largest number of fields of a group.
const MOST_FIELDS: usize = {
    let (mut most, mut groups) = (0, Group::ALL.as_slice());
    while let [group, rest @ ..] = groups {
        most = if group.fields().len() > most { group.fields().len() } else { most };
        groups = rest;
    }
    most
};

/// Raw values of the fields of one group. A field may have no value, and then keeps its setting.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Values {
    group: Group,
    /// Raw values in the order of the fields, each in the range of its field. `None` for a field without a value.
    raw: [Option<i64>; MOST_FIELDS],
}

impl Values {
    /// Collects the raw values that `value` returns for the fields. `value` must return values in the range of the
    /// field, or `None` for a field that keeps its setting.
    ///
    /// # Errors
    /// Returns the first error of `value`.
    pub fn collect<E>(
        group: Group,
        mut value: impl FnMut(&Field) -> Result<Option<i64>, E>,
    ) -> Result<Self, E> {
        let mut raw = [None; MOST_FIELDS];
        for (slot, field) in raw.iter_mut().zip(group.fields()) {
            *slot = value(field)?;
        }
        Ok(Self { group, raw })
    }

    /// Returns the values of a group in these settings.
    pub fn of(group: Group, settings: &MotorSettings) -> Self {
        let Ok(values) = Self::collect(group, |field| Ok::<_, Infallible>(Some(field.get(settings))));
        values
    }

    /// Reads the values of a group from a payload. The number of the motor and the code of the loop must have been
    /// read. The payload may end before a field that a later version has added.
    ///
    /// # Errors
    /// Refuses any other field that is missing, and a field that is out of range, with the number of the field in the
    /// payload.
    pub fn read(group: Group, fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Self::collect(group, |field| field.read(fields))
    }

    /// Reads the values of a group from bytes that an earlier firmware may have written, in an answer or in a stored
    /// entry. A field that is missing at the end is taken from `settings`.
    ///
    /// # Errors
    /// Refuses a field that is out of range.
    pub fn read_over(group: Group, bytes: &[u8], settings: &MotorSettings) -> Result<Self, Nack> {
        let mut payload = Payload::new();
        Self::of(group, settings).write(&mut payload);
        for (byte, given) in payload.iter_mut().zip(bytes) {
            *byte = *given;
        }
        Self::read(group, &mut Fields::new(&payload))
    }

    /// Appends the values to a payload, up to the first field without a value.
    pub fn write(&self, payload: &mut Payload) {
        for (field, raw) in self.group.fields().iter().zip(self.raw.into_iter().map_while(|raw| raw)) {
            field.write(raw, payload);
        }
    }

    /// Returns the group of the values.
    pub const fn group(&self) -> Group {
        self.group
    }

    /// Returns a copy of `settings` in which this group has these values.
    ///
    /// # Errors
    /// Refuses linear current if the resistance in these values is 0, even if the motor already has a configured
    /// resistance. Refuses a thermal limit with a time constant of 0. The refusal has the number of the field in the
    /// payload.
    pub fn apply_to(&self, settings: &MotorSettings) -> Result<MotorSettings, Nack> {
        let mut new = *settings;
        if self.group == Group::SetUp {
            // Dynamics, acceleration limit and coefficients are deleted. The duty rule is a field of this group, and is
            // set below. Each field of the settings is named, so that a new field must be kept or deleted here.
            let Settings {
                winding,
                bridge,
                scheme,
                zero_power,
                on_fault,
                thermal,
                current_limit,
                duty: _,
                dynamics: _,
                coefficients: _,
                acceleration: _,
            } = settings.motor;
            let unknown = Settings::for_scheme(winding, scheme);
            new.motor = Settings { bridge, zero_power, on_fault, thermal, current_limit, ..unknown };
        }
        // The number of the motor, and for coefficients the code of the loop, are the first fields of the payload.
        let first = if self.group.loop_of().is_some() { 2 } else { 1 };
        for ((index, field), raw) in (first..).zip(self.group.fields()).zip(self.raw) {
            if let Some(raw) = raw {
                field.set(&mut new, raw).ok_or(Nack::parameter(index))?;
            }
        }
        // The second field of a set-up is the resistance.
        if let (Group::SetUp, [_, Some(0), ..]) = (self.group, self.raw) {
            if new.motor.duty == DutyRule::LinearCurrent {
                return Err(Nack::parameter(2));
            }
            new.motor.winding = Winding { emf: new.motor.winding.emf, ..settings.motor.winding };
        }
        Ok(new)
    }
}

/// Defines a list of fields.
///
/// A number has the parts `name, integer type in a packet / steps per unit, get, set`. `limits` replaces the limits of
/// the integer type. `zero` states the meaning of the raw value 0, which otherwise is the number 0. If the setting has
/// the integer type of the packet, and no other limits, the path of the setting replaces `get` and `set`, for example
/// `; motor.bridge.timing.change_us`.
///
/// A choice has the parts `name, each word with its value; path of the setting`. `up to` replaces the largest raw
/// value. A raw value beyond the last word sets the value of the last word, and [`Field::word_of`] returns `None` for
/// the raw value.
///
/// Both kinds may end with `since` and `option`, which are the members of [`Field`] with these names.
macro_rules! fields {
    (@ {
        $name:literal, $type:ident / $steps:expr $(, limits $least:literal to $most:expr)? $(, zero $zero:ident)?
        $(, since $since:literal)? $(, option $option:literal)?,
        |$settings:ident| $get:expr, |$into:ident, $value:ident| $put:expr
    }) => {
        Field {
            name: $name,
            form: Form::Steps($steps),
            zero: stated_or(&[$(Zero::$zero)?], Zero::Value),
            since: stated_or(&[$(Some($since))?], None),
            #[cfg(not(target_os = "none"))]
            option: stated_or(&[$(Some($option))?], None),
            size: size_of::<$type>(),
            signed: $type::MIN != 0,
            least: stated_or(&[$($least)?], $type::MIN as i64),
            most: stated_or(&[$($most)?], $type::MAX as i64),
            get: |$settings| i64::from($get),
            set: |$into, value| {
                let $value = $type::try_from(value).ok()?;
                $put;
                Some(())
            },
        }
    };
    (@ {
        $name:literal, $type:ident / $steps:expr; $($place:ident).+
        $(, since $since:literal)? $(, option $option:literal)?
    }) => {
        fields!(@ {
            $name, $type / $steps $(, since $since)? $(, option $option)?,
            |settings| settings.$($place).+, |settings, value| settings.$($place).+ = value
        })
    };
    (@ {
        $name:literal, $($word:literal $value:expr),+; $($place:ident).+ $(, up to $most:literal)?
        $(, since $since:literal)? $(, option $option:literal)?
    }) => {
        Field {
            name: $name,
            form: Form::Words(&[$($word),+]),
            zero: Zero::Value,
            since: stated_or(&[$(Some($since))?], None),
            #[cfg(not(target_os = "none"))]
            option: stated_or(&[$(Some($option))?], None),
            size: 1,
            signed: false,
            least: 0,
            most: stated_or(&[$($most)?], [$($word),+].len() as i64 - 1),
            get: |settings| {
                let mut values = [$($value),+].into_iter();
                // Scheme D with a blend other than 0 is not in the list. Its word is the last word.
                let last = values.len() as i64 - 1;
                values.position(|value| value == settings.$($place).+).map_or(last, |code| code as i64)
            },
            set: |settings, code| {
                let values = [$($value),+];
                settings.$($place).+ = *values.get(usize::try_from(code).ok()?).or(values.last())?;
                Some(())
            },
        }
    };
    ($($fields:tt)*) => { &[$(fields!(@ $fields)),*] };
}

/// Returns the part that a field states, or `default` if the field does not state this part.
const fn stated_or<T: Copy>(stated: &[T], default: T) -> T {
    match stated {
        [stated, ..] => *stated,
        [] => default,
    }
}

/// Fields of [`Group::SetUp`]. `blend` depends on `scheme`.
const SET_UP: &[Field] = fields! {
    {
        "emf_mv_s_per_count", i32 / 1 << 20, limits 1 to (1 << 25) - 1,
        |settings| settings.motor.winding.emf.to_bits(),
        |settings, bits| settings.motor.winding.emf = EmfConstant::from_bits(bits).ok()?
    }
    {
        "resistance_ohm", u16 / 1_000, zero Keeps,
        |settings| settings.motor.winding.resistance.as_milliohms(),
        |settings, milliohms| if let Ok(resistance) = Resistance::from_milliohms(milliohms) {
            settings.motor.winding.resistance = resistance;
        }
    }
    {
        "inductance_mh", u16 / 1_000, zero NotConfigured,
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
        // A blend of 1, which is the same as Scheme C, does not fit in 16 bits. Its raw value is that of the largest
        // blend below 1.
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
    { "bridge.least_off_ns", u16 / 1; motor.bridge.timing.least_off_ns }
    { "bridge.least_on_ns", u16 / 1; motor.bridge.timing.least_on_ns }
    { "bridge.turn_on_ns", u16 / 1; motor.bridge.timing.turn_on_ns }
    { "bridge.turn_off_ns", u16 / 1; motor.bridge.timing.turn_off_ns }
    { "bridge.change_us", u16 / 1; motor.bridge.timing.change_us }
};

/// Fields of [`Group::Protection`]. The time constants depend on `thermal.continuous_current_ma`.
const PROTECTION: &[Field] = fields! {
    {
        "on_fault", "coast" OnFault::Coast, "brake" OnFault::Brake; motor.on_fault,
        option "Behaviour of the motor at a fault, and when its host is silent"
    }
    {
        "thermal.continuous_current_ma", u16 / 1, zero NotConfigured,
        option "Current that the winding tolerates continuously; 0 for no limit \
            [default with --type: a third of the stall current]",
        |settings| settings.motor.thermal.map_or(0, |limit| limit.continuous_ma()),
        |settings, ma| settings.motor.thermal =
            ThermalLimit::new(ma, ThermalLimit::USUAL_WINDING_S, ThermalLimit::USUAL_CASE_S).ok()
    }
    {
        "thermal.winding_s", u16 / 1, zero NotConfigured,
        |settings| settings.motor.thermal.map_or(0, |limit| limit.winding_s()),
        |settings, winding_s| if let Some(limit) = &mut settings.motor.thermal {
            *limit = ThermalLimit::new(limit.continuous_ma(), winding_s, limit.case_s()).ok()?;
        }
    }
    {
        "thermal.case_s", u16 / 1, zero NotConfigured,
        |settings| settings.motor.thermal.map_or(0, |limit| limit.case_s()),
        |settings, case_s| if let Some(limit) = &mut settings.motor.thermal {
            *limit = ThermalLimit::new(limit.continuous_ma(), limit.winding_s(), case_s).ok()?;
        }
    }
};

const CURRENT_LIMIT: &[Field] = fields! {
    {
        "current_limit_ma", u16 / 1, zero NotConfigured,
        option "Largest current of the motor, driving or braking; 0 for no limit",
        |settings| settings.motor.current_limit.map_or(0, NonZeroU16::get),
        |settings, ma| settings.motor.current_limit = NonZeroU16::new(ma)
    }
};

/// Fields of [`Group::Motion`]. Decay and friction depend on `dynamics.acceleration_cps2_per_v`.
const MOTION: &[Field] = fields! {
    {
        "dynamics.acceleration_cps2_per_v", u32 / 1 << 8, zero NotConfigured,
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
        "acceleration_limit_cps2", u32 / 1, zero NotConfigured,
        |settings| settings.motor.acceleration.map_or(0, Acceleration::get),
        |settings, limit| settings.motor.acceleration = Acceleration::new(limit).ok()
    }
};

const MODE: &[Field] = fields! {
    { "mode", "power" RunMode::Power, "velocity" RunMode::Velocity, "position" RunMode::Position; mode }
    // Hosts may send any byte except 0 for `float`.
    { "at_zero_power", "brake" ZeroPower::Brake, "float" ZeroPower::Float; motor.zero_power, up to 255 }
};

const CURRENT_ALERT: &[Field] = fields! {
    { "current_alert_ma", u16 / 1; current_alert_ma }
};

/// Defines the fields of one loop: its coefficients, and then its terms.
macro_rules! coefficients {
    ($loop:ident, $($name:literal $field:ident),+; $terms_name:literal $terms:ident) => {
        fields! {
            $({
                $name, i32 / 1 << 16,
                |settings| settings.coefficients(Loop::$loop).$field.to_bits(),
                |settings, bits| {
                    let before = settings.coefficients(Loop::$loop);
                    let $field = Coefficient::from_bits(bits);
                    settings.set_coefficients(Loop::$loop, LoopCoefficients { $field, ..before });
                }
            })+
            { $terms_name, "pid" Terms::Pid, "pidf" Terms::Pidf; $terms }
        }
    };
}

const VELOCITY_LOOP: &[Field] = coefficients!(
    Velocity, "velocity_loop.p" p, "velocity_loop.i" i, "velocity_loop.d" d,
    "velocity_loop.f" f; "velocity_loop.terms" velocity_terms
);

const POSITION_LOOP: &[Field] = coefficients!(
    Position, "position_loop.p" p, "position_loop.i" i, "position_loop.d" d,
    "position_loop.f" f; "position_loop.terms" position_terms
);

#[cfg(test)]
mod tests {
    use super::*;

    /// A table as a later version could have it: the last two fields were added.
    const LONGER: &[Field] = fields! {
        { "on_fault", "coast" OnFault::Coast, "brake" OnFault::Brake; motor.on_fault }
        { "bridge.turn_on_ns", u16 / 1; motor.bridge.timing.turn_on_ns, since "0.2.0" }
        {
            "current_limit_ma", u16 / 1, zero NotConfigured, since "0.3.0",
            |settings| settings.motor.current_limit.map_or(0, NonZeroU16::get),
            |settings, ma| settings.motor.current_limit = NonZeroU16::new(ma)
        }
    };

    #[test]
    fn a_request_of_an_older_host_may_lack_the_fields_that_a_later_version_added() {
        let bytes = [1, 0x90, 1, 0x20, 3];
        let read = |length: usize| -> Result<heapless::Vec<Option<i64>, 3>, Nack> {
            let fields = &mut Fields::new(bytes.get(..length).unwrap_or_default());
            LONGER.iter().map(|field| field.read(fields)).collect()
        };
        assert_eq!(read(5).as_deref(), Ok(&[Some(1), Some(400), Some(800)][..]));
        assert_eq!(read(3).as_deref(), Ok(&[Some(1), Some(400), None][..]));
        assert_eq!(read(1).as_deref(), Ok(&[Some(1), None, None][..]));
        // A part of a field is an error, and so is a missing field that every host knows.
        assert_eq!(
            [read(4), read(2), read(0)].map(Result::err),
            [2, 1, 0].map(|at| Some(Nack::parameter(at)))
        );
    }

    #[test]
    fn a_signed_field_keeps_its_sign_at_each_size() {
        for (size, bytes, raw) in
            [(1, &[0x80][..], -128), (2, &[0xFE, 0xFF], -2), (4, &[0, 0, 0, 0x80], -1 << 31)]
        {
            let signed =
                |field: &Field| Field { size, signed: true, least: i64::MIN, most: i64::MAX, ..*field };
            let read = SET_UP.first().map(|field| signed(field).read(&mut Fields::new(bytes)));
            assert_eq!(read, Some(Ok(Some(raw))), "{size} bytes");
        }
    }

    #[test]
    fn a_field_without_a_value_keeps_its_setting() {
        let limit = ThermalLimit::new(1_200, 20, 600).ok();
        let motor = Settings { thermal: limit, ..Settings::new(Winding::NEVEREST_60) };
        let before = MotorSettings::new(motor);
        let mut values = Values::of(Group::Protection, &before);
        values.raw = [None; MOST_FIELDS];
        values.raw[0] = Some(1);
        let braking = Settings { on_fault: OnFault::Brake, ..motor };
        assert_eq!(values.apply_to(&before), Ok(MotorSettings::new(braking)));
        let mut payload = Payload::new();
        values.write(&mut payload);
        assert_eq!(*payload, [1]);
    }
}
