//! Options for single settings of a motor, which follow from the firmware's table of settings.

use crate::output::Failure;
use clap::builder::{PossibleValuesParser, TypedValueParser, ValueParser};
use clap::{Arg, ArgMatches, Args, Command, Error, FromArgMatches};
use motor_hub::extension::settings::{Field, Form, Group, MotorSettings, Zero};
use serde_json::{Value, json};

/// A setting that has an option of its own. The option, the JSON field and the row of the table are named after the key
/// in a settings file, without the key's table. A setting in mA is shown in A.
#[derive(Clone, Copy)]
pub(crate) struct SettingOption {
    field: &'static Field,
    /// Help of the option.
    help: &'static str,
    /// Name without the unit.
    name: &'static str,
    /// Unit in lower case; empty for words.
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
        let key = field.name.split_once('.').map_or(field.name, |(_, key)| key);
        let (name, unit, scale) = match (field.form, key.rsplit_once('_')) {
            (Form::Steps(_), Some((name, "ma"))) => (name, "a", 1e3),
            (Form::Steps(_), Some((name, unit))) => (name, unit, 1.0),
            _ => (key, "", 1.0),
        };
        Some(Self { field, help: field.option?, name, unit, scale })
    }

    /// Returns the name of the JSON field, such as `current_limit_a`.
    pub(crate) fn key(self) -> String {
        [self.name, self.unit].join("_").trim_end_matches('_').to_owned()
    }

    /// Returns the name in a table, such as `current limit`.
    pub(crate) fn label(self) -> String {
        self.name.replace('_', " ")
    }

    /// Returns the value as JSON; null if the setting is not configured.
    pub(crate) fn json(self, settings: &MotorSettings) -> Value {
        let raw = self.field.get(settings);
        match self.field.word_of(raw) {
            Some(word) => word.into(),
            None => json!(self.is_configured(raw).then(|| self.field.number_of(raw) / self.scale)),
        }
    }

    /// Returns the value for a table.
    pub(crate) fn text(self, settings: &MotorSettings) -> String {
        match self.json(settings) {
            Value::String(word) => word,
            Value::Number(number) => format!("{:.3} {}", number.as_f64().unwrap_or_default(), self.symbol()),
            _ => "not configured".to_owned(),
        }
    }

    fn is_configured(self, raw: i64) -> bool {
        self.field.zero != Zero::NotConfigured || raw != 0
    }

    /// Returns the symbol of the unit.
    fn symbol(self) -> &'static str {
        match self.unit {
            "a" => "A",
            "v" => "V",
            unit => unit,
        }
    }

    /// Converts the value of the option to the raw value of the setting.
    fn parse(self, text: &str) -> Result<i64, String> {
        let number: Option<f64> = text.parse().ok();
        let optional = self.field.zero == Zero::NotConfigured;
        if optional && number == Some(0.0) {
            return Ok(0);
        }
        number.and_then(|number| self.field.raw_of(number * self.scale)).ok_or_else(|| {
            let (least, most) = self.field.range();
            let (least, most, symbol) = (least / self.scale, most / self.scale, self.symbol());
            format!("allowed is {least} to {most} {symbol}{}", if optional { ", or 0 for none" } else { "" })
        })
    }

    fn arg(self) -> Arg {
        let parser: ValueParser = match self.field.form {
            Form::Words(words) => {
                let raw =
                    move |word: String| self.field.raw_of_word(&word.to_lowercase()).ok_or("unknown word");
                PossibleValuesParser::new(words).try_map(raw).into()
            }
            Form::Steps(_) => (move |text: &str| self.parse(text)).into(),
        };
        let arg = Arg::new(self.field.name).long(self.key().replace('_', "-")).help(self.help);
        match self.unit {
            "" => arg.value_name("WORD").ignore_case(true),
            unit => arg.value_name(unit.to_uppercase()).alias(self.name.replace('_', "-")),
        }
        .value_parser(parser)
    }
}

/// The settings that are given by their options, with their raw values.
pub(crate) struct SettingOptions(Vec<(SettingOption, i64)>);

impl SettingOptions {
    /// Changes the settings that are given.
    pub(crate) fn apply_to(&self, settings: &mut MotorSettings) -> Result<(), Failure> {
        for (option, raw) in &self.0 {
            let refused = || Failure::Input(format!("the motor cannot have this {}", option.label()));
            option.field.set(settings, *raw).ok_or_else(refused)?;
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
        let given = |option: SettingOption| Some((option, *matches.get_one(option.field.name)?));
        Ok(Self(SettingOption::all().filter_map(given).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}
