//! Values of options that several commands have.

use motor_hub::protocol::{Address, CHANNELS};
use simulated::scenario::LONGEST_S;
use std::ops::RangeInclusive;
use std::time::Duration;

/// The longest time that a command of `client` runs by the clock: a day.
const DAY_S: f64 = 86_400.0;

/// A hub's address.
pub(crate) fn address(text: &str) -> Result<Address, String> {
    let address = text.parse().ok().and_then(Address::new);
    address.ok_or_else(|| "an address is a whole number from 1 to 254".to_owned())
}

/// A motor of the protocol.
pub(crate) fn channel(text: &str) -> Result<u8, String> {
    let channel = text.parse().ok().filter(|channel| usize::from(*channel) < CHANNELS);
    channel.ok_or_else(|| format!("a motor is 0 to {}", CHANNELS - 1))
}

/// A length in seconds by the clock, of any size.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    within(text, f64::MIN_POSITIVE..=f64::MAX).ok_or_else(|| "a length is more than 0 seconds".to_owned())
}

/// A length in seconds by the clock, at most a day.
pub(crate) fn within_a_day(text: &str) -> Result<Duration, String> {
    let length = within(text, f64::MIN_POSITIVE..=DAY_S).map(Duration::from_secs_f64);
    length.ok_or_else(|| format!("a length is more than 0 and at most {DAY_S} seconds"))
}

/// The length of a scenario's run in seconds.
pub(crate) fn run_seconds(text: &str) -> Result<f64, String> {
    let length = within(text, 0.001..=LONGEST_S);
    length.ok_or_else(|| format!("a length is more than 0 and at most {LONGEST_S} seconds"))
}

fn within(text: &str, allowed: RangeInclusive<f64>) -> Option<f64> {
    text.parse().ok().filter(|length| allowed.contains(length))
}
