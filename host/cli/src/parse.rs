//! Parsers for the values of options.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, Command};
use motor_hub::protocol::payload::ByteIn;
use motor_hub::protocol::pins::Pin;
use motor_hub::protocol::{Address, CHANNELS};
use motor_hub::units::Control;
use motor_hub_client::line::{is_tcp, tcp_port};
use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

/// Longest duration of a `client` command: one day in seconds.
const DAY_S: f64 = 86_400.0;

/// Returns the command so that "-1" is accepted as the value of an option. The error of the option's own parser then
/// names the allowed range.
pub(crate) fn with_negative_numbers(command: Command) -> Command {
    let values = |arg: Arg| {
        let some = arg.get_action().takes_values() && !arg.is_allow_hyphen_values_set();
        if some { arg.allow_negative_numbers(true) } else { arg }
    };
    command.mut_args(values).mut_subcommands(with_negative_numbers)
}

/// Parses a hub's address.
pub(crate) fn address(text: &str) -> Result<Address, String> {
    let address = text.parse().ok().and_then(Address::new);
    address.ok_or_else(|| "an address is a whole number from 1 to 254".to_owned())
}

/// Checks that the text has the form HOST:PORT. The connection is made later.
pub(crate) fn host_and_port(text: &str) -> Result<String, String> {
    if is_tcp(text) && tcp_port(text).is_some() {
        Ok(text.to_owned())
    } else {
        Err("give HOST:PORT, such as 127.0.0.1:7070; a port is 0 to 65535".to_owned())
    }
}

/// Parses two values with a comma between them.
pub(crate) fn pair<T: FromStr>(text: &str) -> Option<[T; 2]> {
    let (first, second) = text.split_once(',')?;
    Some([first.trim().parse().ok()?, second.trim().parse().ok()?])
}

/// Parses the two digital pins that a wire connects.
pub(crate) fn wire(text: &str) -> Result<[Pin; 2], String> {
    let ends = pair(text).and_then(|[from, to]| Some([Pin::new(from)?, Pin::new(to)?]));
    ends.filter(|[from, to]| from != to)
        .ok_or_else(|| "a wire is between two digital pins, 0 to 7, such as 4,5".to_owned())
}

/// A motor of the hub, or of another hub of its chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct MotorName {
    /// Address of the hub; `None` if the user gives no address.
    pub(crate) hub: Option<Address>,
    /// Number of the motor.
    pub(crate) number: u8,
}

/// Parses a motor: its number, or the address of its hub and its number, as 3:0.
pub(crate) fn motor(text: &str) -> Result<MotorName, String> {
    let (hub, number) = match text.split_once(':') {
        Some((hub, number)) => (Some(address(hub)?), number),
        None => (None, text),
    };
    let number = number.parse().ok().filter(|number| usize::from(*number) < CHANNELS);
    let number = number
        .ok_or_else(|| format!("a motor is 0 to {}; motor 0 of the hub at address 3 is 3:0", CHANNELS - 1))?;
    Ok(MotorName { hub, number })
}

/// Returns the address of the hub that all motors of a command belong to; `None` if the user gives no address.
pub(crate) fn common_hub(mut motors: impl Iterator<Item = MotorName>) -> Result<Option<Address>, String> {
    let first = motors.next().and_then(|motor| motor.hub);
    if motors.all(|motor| motor.hub == first) {
        Ok(first)
    } else {
        Err("the motors belong to different hubs; a command is for motors of one hub".to_owned())
    }
}

/// Parses a duration in seconds, without an upper limit.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    within(text, f64::MIN_POSITIVE..=f64::MAX).ok_or_else(|| "a duration is more than 0 s".to_owned())
}

/// Parses a duration in seconds, at most a day.
pub(crate) fn within_a_day(text: &str) -> Result<Duration, String> {
    let length = within(text, f64::MIN_POSITIVE..=DAY_S).map(Duration::from_secs_f64);
    length.ok_or_else(|| format!("a duration is more than 0 and at most {DAY_S} s"))
}

/// Returns a parser of whole numbers: `what` names the quantity ("a control period"), `unit` is "" for none.
pub(crate) fn whole<T: FromStr + PartialOrd + Display + Clone>(
    what: &'static str,
    allowed: RangeInclusive<T>,
    unit: &'static str,
) -> impl Fn(&str) -> Result<T, String> + Clone {
    move |text| {
        let value = text.parse().ok().filter(|value| allowed.contains(value));
        let (low, high) = (allowed.start(), allowed.end());
        value.ok_or_else(|| {
            format!("{what} is a whole number from {low} to {high} {unit}").trim_end().to_owned()
        })
    }
}

/// Returns a parser of a whole number with the limits of its type: `what` names the number ("a servo output").
pub(crate) fn byte_in<const LOW: u8, const HIGH: u8>(
    what: &'static str,
    new: fn(u8) -> Option<ByteIn<LOW, HIGH>>,
) -> impl Fn(&str) -> Result<ByteIn<LOW, HIGH>, String> + Clone {
    move |text| text.parse().ok().and_then(new).ok_or_else(|| format!("{what} is {LOW} to {HIGH}"))
}

/// Returns a parser of names in upper or lower case. Each element has a name, its description for the help, and its
/// value.
pub(crate) fn named<T: Copy + Send + Sync + 'static, const N: usize>(
    values: [(&'static str, &'static str, T); N],
) -> impl TypedValueParser<Value = T> {
    let names = values.map(|(name, help, _)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(names).try_map(move |given| {
        let found = values.iter().find(|(name, ..)| name.eq_ignore_ascii_case(&given));
        found.map(|(.., value)| *value).ok_or("this name is unknown")
    })
}

/// Returns a parser of numbers: `what` names the quantity ("a resistance"), `unit` is "" for none.
pub(crate) fn number(
    what: &'static str,
    allowed: RangeInclusive<f64>,
    unit: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone {
    move |text| {
        let (low, high) = (allowed.start(), allowed.end());
        let value = within(text, allowed.clone());
        value.ok_or_else(|| format!("{what} is a number from {low} to {high} {unit}").trim_end().to_owned())
    }
}

/// Lowest allowed battery voltage in mV. A user who gives a smaller number probably means volts.
const LEAST_BATTERY_MV: u16 = 1000;

/// Parses a battery's voltage in millivolts.
pub(crate) fn battery_mv(text: &str) -> Result<u16, String> {
    let allowed = LEAST_BATTERY_MV..=u16::MAX;
    let value = text.parse().ok().filter(|mv| allowed.contains(mv));
    value.ok_or_else(|| {
        let volts = within(text, 1.0..=60.0).map(|volts| format!("; did you mean {:.0}?", 1e3 * volts));
        let range = format!("a battery voltage is a whole number from {LEAST_BATTERY_MV} to {} mV", u16::MAX);
        range + &volts.unwrap_or_default()
    })
}

/// Parses a share of full control, -1 to 1; `None` for any other text.
pub(crate) fn share(text: &str) -> Option<Control> {
    let share = within(text, -1.0..=1.0)?;
    Some(Control::new((share * f64::from(Control::MAX.get())).round() as i16))
}

fn within(text: &str, allowed: RangeInclusive<f64>) -> Option<f64> {
    text.parse().ok().filter(|length| allowed.contains(length))
}
