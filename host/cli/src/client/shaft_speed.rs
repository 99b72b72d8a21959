//! Speeds of the output shaft: encoder counts in a turn, and conversion of rpm and rad/s to counts per second.

use crate::output::Failure;
use crate::parse::number;
use motor_hub::model::catalogue::{Motor, characterised};
use std::f64::consts::TAU;
use std::str::FromStr;

/// Encoder counts in a turn of the output shaft, given as a number or by the motor.
#[derive(Clone, clap::Args)]
pub(super) struct ShaftOptions {
    /// Encoder counts in a turn of the output shaft: allows speeds in rpm and rad/s, and shows them
    #[arg(long, value_name = "COUNTS")]
    #[arg(value_parser = number("an encoder's resolution", 1.0..=1e6, "counts in a turn"))]
    counts_per_turn: Option<f64>,
    /// Counts per turn by the motor's name, such as "NeveRest 60"; see `motor-hub motors`
    #[arg(long = "type", value_name = "NAME", conflicts_with = "counts_per_turn", value_parser = characterised)]
    motor_type: Option<Motor>,
}

impl ShaftOptions {
    /// Returns the encoder counts in a turn; `None` if neither option is given.
    pub(super) fn counts(&self) -> Option<f64> {
        self.motor_type.map(|motor| motor.counts_per_rev_output()).or(self.counts_per_turn)
    }
}

/// Converts counts per second to rpm and rad/s of the output shaft. `counts_per_turn` is the number of encoder counts in a turn.
pub(super) fn shaft_speed(cps: i16, counts_per_turn: f64) -> (f64, f64) {
    let turns = f64::from(cps) / counts_per_turn;
    (60.0 * turns, TAU * turns)
}

/// A speed as typed by a user.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Speed {
    /// Counts per second.
    Counts(i16),
    /// Turns of the output shaft per second.
    Turns(f64),
}

impl FromStr for Speed {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let number = |text: &str| text.trim().parse().ok().filter(|value: &f64| value.is_finite());
        let text = text.to_ascii_lowercase();
        let turns = match (text.strip_suffix("rpm"), text.strip_suffix("rad/s")) {
            (Some(rpm), _) => number(rpm).map(|rpm| rpm / 60.0),
            (_, Some(rad)) => number(rad).map(|rad| rad / TAU),
            _ => return text.parse().map(Self::Counts).map_err(|_| WRONG.to_owned()),
        };
        turns.map(Self::Turns).ok_or_else(|| WRONG.to_owned())
    }
}

const WRONG: &str =
    "a speed is a whole number from -32768 to 32767 in counts/s, or a number with the unit rpm or rad/s";

const TURN_UNKNOWN: &str = "rpm and rad/s need the encoder counts in a turn of the output shaft, which a hub does not know; \
give --counts-per-turn COUNTS or --type NAME";

impl Speed {
    /// Returns the speed in counts per second; `counts_per_turn` is the number of encoder counts in a turn.
    pub(super) fn cps(self, counts_per_turn: Option<f64>) -> Result<i16, Failure> {
        let turns = match self {
            Self::Counts(cps) => return Ok(cps),
            Self::Turns(turns) => turns,
        };
        let Some(counts_per_turn) = counts_per_turn else {
            return Err(Failure::input(TURN_UNKNOWN));
        };
        let cps = (turns * counts_per_turn).round();
        if (f64::from(i16::MIN)..=f64::from(i16::MAX)).contains(&cps) {
            return Ok(cps as i16);
        }
        Err(Failure::input(format!("{cps} counts/s is out of range; allowed is -32768 to 32767")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn speeds_are_counts_or_turns_of_the_shaft() {
        let cps = |text: &str| text.parse::<Speed>().unwrap().cps(Some(1680.0)).unwrap();
        assert_eq!(
            [cps("-300"), cps("100rpm"), cps("-100 RPM"), cps("6.2831853rad/s")],
            [-300, 2800, -2800, 1680]
        );
        assert!("30".parse::<Speed>().unwrap().cps(None).is_ok());
        assert!("30rpm".parse::<Speed>().unwrap().cps(None).is_err());
        assert!("3000rpm".parse::<Speed>().unwrap().cps(Some(1680.0)).is_err());
        for wrong in ["", "rpm", "nanrpm", "1.5", "32768", "3 m/s"] {
            assert!(wrong.parse::<Speed>().is_err(), "{wrong}");
        }
    }
}
