//! Options for single settings of a motor, which follow from the firmware's table of settings.

use crate::output::Failure;
use clap::builder::{PossibleValuesParser, TypedValueParser, ValueParser};
use clap::{Arg, ArgMatches, Args, Command, Error, FromArgMatches};
use motor_hub::extension::settings::{Field, Form, Group, MotorSettings, Zero};
use serde_json::{Value, json};

/// A setting that has an option of its own. The option, the JSON field and the row of the table are named after the key
/// in a settings file, without the key's table. A setting in mA is shown in A.
#[derive(Clone)]
pub(crate) struct SettingOption {
    field: &'static Field,
    help: &'static str,
    /// Name in JSON, such as `current_limit_a`. The option has hyphens instead of underscores.
    pub(crate) key: String,
    /// Name without the unit, such as `current limit`.
    pub(crate) label: String,
    /// Unit; empty for words.
    unit: &'static str,
    /// Units of the settings file in one unit of the option.
    scale: f64,
}

impl SettingOption {
    /// Returns all options, in the order of the table.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        Group::ALL.into_iter().flat_map(|group| group.fields()).filter_map(Self::of)
    }

    /// Returns the option of a setting; `None` if the setting has no option.
    fn of(field: &'static Field) -> Option<Self> {
        let help = field.option?;
        let key = field.name.split_once('.').map_or(field.name, |(_, key)| key);
        let (name, unit, scale) = match (field.form, key.rsplit_once('_')) {
            (Form::Steps(_), Some((name, "ma"))) => (name, "A", 1e3),
            (Form::Steps(_), Some((name, "v"))) => (name, "V", 1.0),
            (Form::Steps(_), Some((name, unit))) => (name, unit, 1.0),
            _ => (key, "", 1.0),
        };
        let key = if scale == 1.0 { key.to_owned() } else { format!("{name}_{}", unit.to_lowercase()) };
        Some(Self { field, help, key, label: name.replace('_', " "), unit, scale })
    }

    /// Returns the value as JSON; null if the setting is not configured.
    pub(crate) fn json(&self, settings: &MotorSettings) -> Value {
        let raw = self.field.get(settings);
        match self.field.word_of(raw) {
            Some(word) => word.into(),
            None if self.is_none(raw as f64) => Value::Null,
            None => json!(self.field.number_of(raw) / self.scale),
        }
    }

    /// Returns the value for a table.
    pub(crate) fn text(&self, settings: &MotorSettings) -> String {
        match self.json(settings) {
            Value::String(word) => word,
            Value::Null => "not configured".to_owned(),
            number => format!("{:.3} {}", number.as_f64().unwrap_or_default(), self.unit),
        }
    }

    /// True if the number 0 means that the setting is not configured, and the number is 0.
    fn is_none(&self, number: f64) -> bool {
        self.field.zero == Zero::NotConfigured && number == 0.0
    }

    /// Converts the value of the option to the raw value of the setting.
    fn parse(&self, text: &str) -> Result<i64, String> {
        let (least, most) = self.field.range();
        let or_none = if self.field.zero == Zero::NotConfigured { ", or 0 for none" } else { "" };
        let raw = match text.parse() {
            Ok(number) if self.is_none(number) => Some(0),
            Ok(number) => self.field.raw_of(number * self.scale),
            Err(_) => None,
        };
        raw.ok_or_else(|| {
            format!("allowed is {} to {} {}{or_none}", least / self.scale, most / self.scale, self.unit)
        })
    }

    fn arg(self) -> Arg {
        let Self { field, help, ref key, ref label, unit, .. } = self;
        let arg = Arg::new(field.name).long(key.replace('_', "-")).help(help);
        if let Form::Words(words) = field.form {
            let raw = |word: String| field.raw_of_word(&word.to_lowercase()).ok_or("this word is unknown");
            let parser = PossibleValuesParser::new(words).try_map(raw);
            return arg.value_name("WORD").ignore_case(true).value_parser(parser);
        }
        let arg = arg.value_name(unit.to_uppercase()).alias(label.replace(' ', "-"));
        arg.value_parser(ValueParser::new(move |text: &str| self.parse(text)))
    }
}

/// The settings that are given by their options, with their raw values.
pub(crate) struct SettingOptions(Vec<(&'static Field, i64)>);

impl SettingOptions {
    /// Changes the settings that are given.
    pub(crate) fn apply_to(&self, settings: &mut MotorSettings) -> Result<(), Failure> {
        for (field, raw) in &self.0 {
            let refused = || Failure::Input(format!("the motor cannot have this {}", field.name));
            field.set(settings, *raw).ok_or_else(refused)?;
        }
        Ok(())
    }
}

impl Args for SettingOptions {
    fn augment_args(command: Command) -> Command {
        command.args(SettingOption::all().map(SettingOption::arg))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for SettingOptions {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, Error> {
        let given = |of: SettingOption| Some((of.field, *matches.get_one(of.field.name)?));
        Ok(Self(SettingOption::all().filter_map(given).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}
