//! Reads the settings of a hub into a TOML document, and reads a document to put its settings in force again. The
//! firmware's table of settings gives the keys.

use motor_hub::braking::{Blend, BlendFraction, Scheme, Winding};
use motor_hub::extension::settings::{Field, Form, Group, MotorSettings, Values, Zero};
use motor_hub::group::{BaseSettings, DriveBase};
use motor_hub::motor::Settings;
use motor_hub::protocol::CHANNELS;
use motor_hub_client::motor::NO_SUCH_MOTOR;
use motor_hub_client::request_text::of_group;
use motor_hub_client::{Error, Session};
use serde::{Deserialize, Serialize};
use simulated::scenario::line_and_column;
use simulated::scheme::{BlendChoice, SchemeName};
use std::collections::BTreeSet;
use std::fmt;
use toml::{Table, Value};

/// Version of the document that this program writes and reads.
const SCHEMA_VERSION: i64 = 1;

/// First line of a document.
const HEAD: &str = "# Settings of a motor hub: `motor-hub client settings import FILE` puts them in force. They end with the line \"# end\".";

/// Last line of a document that begins with [`HEAD`]. Without it the document was cut: a document that is cut after a
/// table is a correct document with fewer settings.
const END: &str = "# end";

/// The settings in force on a hub as a document.
///
/// # Errors
/// The exchange with the hub fails, or the hub does not report its settings.
pub fn export(session: &mut Session) -> Result<String, Error> {
    let mut text = format!("{HEAD}\nschema_version = {SCHEMA_VERSION}\n");
    // A hub that stores nothing does not report which coefficients a host has set.
    let set_by_host = match session.stored_if_reported()? {
        Some(report) => report.coefficients,
        None => {
            text.push_str(
                "# This hub does not report coefficients that a host has set: they are not in this file.\n",
            );
            0
        }
    };
    if let Some(base) = session.base_if_reported()? {
        text.push_str(&BaseTable::of(&base).text());
    }
    for motor in 0..CHANNELS as u8 {
        let mut settings = match session.settings(motor) {
            // The hub has fewer motors.
            Err(Error::Refused { reason: NO_SUCH_MOTOR, .. }) if motor > 0 => break,
            settings => settings?,
        };
        if set_by_host >> motor & 1 != 0 {
            for group in [Group::VelocityLoop, Group::PositionLoop] {
                settings = session.get(motor, group, &settings)?;
            }
        }
        text.push_str(&motor_text(motor, &settings));
    }
    text.push_str(&format!("\n{END}\n"));
    Ok(text)
}

/// The table `[base]`, which has the settings of the drive base.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields, expecting = "a table [base]")]
struct BaseTable {
    wheels: [u8; 2],
    wheel_diameter_mm: f64,
    track_mm: f64,
    counts_per_turn: [f64; 2],
    use_gyro: bool,
}

impl BaseTable {
    fn of(base: &BaseSettings) -> Self {
        let DriveBase { wheel_diameter_mm, track_mm, counts_per_turn } = base.geometry();
        Self { wheels: base.wheels, wheel_diameter_mm, track_mm, counts_per_turn, use_gyro: base.use_gyro }
    }

    fn text(&self) -> String {
        toml::to_string(self).map(|fields| format!("\n[base]\n{fields}")).unwrap_or_default()
    }

    fn settings(&self) -> Result<BaseSettings, String> {
        let &Self { wheels, wheel_diameter_mm, track_mm, counts_per_turn, use_gyro } = self;
        let most = CHANNELS - 1;
        if wheels.iter().any(|wheel| usize::from(*wheel) > most) {
            return Err(format!("base: wheels are {wheels:?}; allowed are motors of 0 to {most}"));
        }
        let base = DriveBase { wheel_diameter_mm, track_mm, counts_per_turn };
        BaseSettings::new(wheels, &base, use_gyro).map_err(|error| format!("base: {error}"))
    }
}

/// The settings of one motor. Keys of the motor itself come before the motor's tables, as TOML requires.
fn motor_text(motor: u8, settings: &MotorSettings) -> String {
    let groups = Group::ALL.into_iter().filter(|group| group.is_configured(settings));
    let fields: Vec<&Field> = groups.flat_map(|group| group.fields()).collect();
    let mut text = format!("\n[[motor]]\nnumber = {motor}\n");
    for field in fields.iter().filter(|field| !field.name.contains('.')) {
        if let Some(value) = value(field, settings) {
            text.push_str(&format!("{} = {value}\n", field.name));
        }
    }
    let mut table = ("", false);
    for field in fields {
        let Some((name, key)) = field.name.split_once('.') else { continue };
        let value = value(field, settings);
        if table.0 != name {
            // The first field of a table decides whether the table is configured.
            table = (name, value.is_some());
            if value.is_some() {
                text.push_str(&format!("\n[motor.{name}]\n"));
            }
        }
        if let (true, Some(value)) = (table.1, value) {
            text.push_str(&format!("{key} = {value}\n"));
        }
    }
    text
}

/// The value of a field; `None` if the field is left out of a document.
fn value(field: &Field, settings: &MotorSettings) -> Option<Value> {
    let raw = field.get(settings);
    match (field.name, settings.motor.scheme) {
        // The firmware has two codes of Scheme D, one for the automatic blend. A document has one word, and the key
        // `blend` is "auto" or a number.
        ("scheme", Scheme::D(_)) => Some("D".into()),
        ("blend", Scheme::D(Blend::Automatic)) => Some("auto".into()),
        ("blend", Scheme::D(Blend::Fixed(_))) => Some(field.number_of(raw).into()),
        ("blend", _) => None,
        _ if field.zero == Zero::NotConfigured && raw == 0 => None,
        _ => Some(word_or_number(field, raw)),
    }
}

/// The value of a setting as a word or a number, for TOML and JSON.
pub(crate) fn word_or_number<V: From<&'static str> + From<i64> + From<f64>>(field: &Field, raw: i64) -> V {
    match field.form {
        Form::Words(_) => field.word_of(raw).unwrap_or_default().into(),
        Form::Steps(1) => raw.into(),
        Form::Steps(_) => field.number_of(raw).into(),
    }
}

/// Settings of a document.
#[derive(Default)]
pub struct SettingsFile {
    /// The settings for each motor. A hub puts them in force in this order.
    pub motors: Vec<(u8, Vec<Values>)>,
    /// The drive base. `None` does not change the base of the hub.
    pub base: Option<BaseSettings>,
}

/// The settings of a document, if all values are in range.
///
/// # Errors
/// A text that names the line and column of a syntax error, or motor or base and key, the given value, and the allowed
/// values.
pub fn read(text: &str) -> Result<SettingsFile, String> {
    let is_cut = text.starts_with(HEAD) && text.lines().all(|line| line.trim_end() != END);
    let mut document: Table = toml::from_str(text).map_err(|error| {
        let (line, column) = line_and_column(text, error.span().unwrap_or_default().start);
        format!("line {line}, column {column}: {}", error.message())
    })?;
    if is_cut {
        return Err(format!(
            "the last line \"{END}\" is missing, as in a file that was cut: export the settings again, or add the line if the file is complete"
        ));
    }
    let version = document
        .remove("schema_version")
        .ok_or_else(|| format!("schema_version is missing; write schema_version = {SCHEMA_VERSION}"))?;
    if version.as_integer() != Some(SCHEMA_VERSION) {
        return Err(format!("schema_version is {version}; this program reads {SCHEMA_VERSION}"));
    }
    let base = document.remove("base").map(Value::try_into::<BaseTable>).transpose();
    let base = base.map_err(|error| format!("base: {}", error.message()))?;
    let motors = match document.remove("motor") {
        Some(Value::Array(motors)) if !motors.is_empty() => motors,
        _ => return Err("there is no [[motor]]".to_owned()),
    };
    if let Some(key) = document.keys().next() {
        return Err(format!(
            "{key} is no key of a settings file; allowed are schema_version, [base] and [[motor]]"
        ));
    }
    let base = base.as_ref().map(BaseTable::settings).transpose()?;
    let mut read: Vec<(u8, Vec<Values>)> = Vec::new();
    for motor in motors {
        let Value::Table(mut motor) = motor else { return Err("motor is no table".to_owned()) };
        let given = motor.remove("number").ok_or("a [[motor]] has no number")?;
        let number = given.as_integer().and_then(|number| u8::try_from(number).ok());
        let is_new = |number: &u8| read.iter().all(|(other, _)| other != number);
        let number = number.filter(|number| usize::from(*number) < CHANNELS && is_new(number));
        let most = CHANNELS - 1;
        let number = number.ok_or_else(|| {
            format!("the number of a motor is {given}; a number is 0 to {most}, and each number occurs once")
        })?;
        read.push((number, values_of(motor).map_err(|why| format!("motor {number}: {why}"))?));
    }
    Ok(SettingsFile { motors: read, base })
}

/// The settings of one motor, in the order of the groups.
fn values_of(motor: Table) -> Result<Vec<Values>, String> {
    let mut motor = MotorKeys::new(motor)?;
    let scheme = take_scheme(&mut motor.values)?;
    let mut settings = MotorSettings::new(Settings::for_scheme(Winding::NEVEREST_60, scheme));
    let mut all = Vec::new();
    for group in Group::ALL {
        let first = group.fields().first();
        let table = first.and_then(|field| field.name.split_once('.')).map(|(table, _)| table);
        if table.is_some_and(|table| table.ends_with("_loop") && !motor.tables.contains(table)) {
            continue;
        }
        let values = Values::collect(group, |field| match field.name {
            "scheme" | "blend" => Ok(Some(field.get(&settings))),
            _ => motor.take(field),
        })?;
        settings = values
            .apply_to(&settings)
            .map_err(|nack| format!("the values of the {}: {nack}", of_group(group)))?;
        // A setting that the file lacks has its default.
        all.push(Values::of(group, &settings));
    }
    Ok(all)
}

/// The keys of a motor that were not read yet.
struct MotorKeys {
    /// Values by the names of their settings: `thermal.winding_s` is the key `winding_s` of the table `thermal`.
    values: Table,
    /// Names of the motor's tables.
    tables: BTreeSet<String>,
}

impl MotorKeys {
    /// Collects the keys of a motor. Refuses a key that is no setting.
    fn new(motor: Table) -> Result<Self, String> {
        let (mut values, mut tables) = (Table::new(), BTreeSet::new());
        for (key, value) in motor {
            match value {
                Value::Table(table) => {
                    values.extend(table.into_iter().map(|(field, value)| (format!("{key}.{field}"), value)));
                    tables.insert(key);
                }
                value => drop(values.insert(key, value)),
            }
        }
        match values.keys().find(|name| Field::named(name).is_none()) {
            Some(name) => Err(is_no_setting(name)),
            None => Ok(Self { values, tables }),
        }
    }

    /// Removes the value of a field and returns the raw value. A missing key has the raw value 0 if it is optional.
    /// Optional are settings outside of tables that need not be configured, and all settings of a missing table other
    /// than `bridge`. A missing key that a later version has added has no value, and so keeps its default.
    fn take(&mut self, field: &Field) -> Result<Option<i64>, String> {
        let name = field.name;
        let Some(given) = self.values.remove(name) else {
            let optional = match name.split_once('.') {
                Some((table, _)) => table != "bridge" && !self.tables.contains(table),
                None => field.zero == Zero::NotConfigured,
            };
            return match field.since {
                _ if optional => Ok(Some(0)),
                Some(_) => Ok(None),
                None => Err(format!("{name} is missing")),
            };
        };
        let number = given.as_float().or_else(|| given.as_integer().map(|whole| whole as f64));
        raw_of(field, given.as_str(), number, &given).map(Some)
    }
}

/// The error of a key that is no setting. Allowed are the keys of the same table, or all keys if no table has this name.
fn is_no_setting(name: &str) -> String {
    let table = |name: &str| name.split_once('.').map(|(table, _)| table.to_owned());
    let all = || Group::ALL.iter().flat_map(|group| group.fields()).map(|field| field.name);
    let mut allowed: Vec<&str> = all().filter(|other| table(other) == table(name)).collect();
    if allowed.is_empty() {
        allowed = all().collect();
    }
    format!("{name} is no setting; allowed are {}", allowed.join(", "))
}

/// Removes scheme and blend from the values of a motor.
fn take_scheme(motor: &mut Table) -> Result<Scheme, String> {
    let name = motor.remove("scheme").ok_or("scheme is missing")?;
    let name: SchemeName = name.try_into().map_err(|error| format!("scheme: {error}"))?;
    let blend = motor.remove("blend").map(Value::try_into::<BlendChoice>).transpose();
    let blend = blend.map_err(|error| format!("blend: {error}"))?;
    match name.with_blend(blend).map_err(|error| format!("blend: {error}"))? {
        // A blend setting has 16 bits, so the largest value is 65535/65536 instead of 1.
        Scheme::D(Blend::Fixed(BlendFraction::ONE)) => {
            let most = BlendFraction::from_bits(u16::MAX.into()).map_err(|error| error.to_string())?;
            Ok(Scheme::D(Blend::Fixed(most)))
        }
        scheme => Ok(scheme),
    }
}

/// The raw value of a setting that is given as a word or as a number.
pub(crate) fn raw_of(
    field: &Field,
    word: Option<&str>,
    number: Option<f64>,
    given: &dyn fmt::Display,
) -> Result<i64, String> {
    let (raw, allowed) = match field.form {
        Form::Words(words) => (word.and_then(|word| field.raw_of_word(word)), words.join(", ")),
        Form::Steps(_) => {
            let (least, most) = field.range();
            (number.and_then(|number| field.raw_of(number)), format!("{} to {}", shown(least), shown(most)))
        }
    };
    raw.ok_or_else(|| format!("{} is {given}; allowed is {allowed}", field.name))
}

/// Formats a limit with at most seven decimals.
fn shown(limit: f64) -> String {
    let text = format!("{limit:.7}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
