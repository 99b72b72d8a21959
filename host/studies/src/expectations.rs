//! Judges whether a run meets its scenario's expectations. Each expectation gets its measurement.
//!
//! An expectation without a measurement is not met. There is no measurement if no set-point changed, if the time was
//! too short to judge a change, or if the window has no control tick.

use crate::groups;
use crate::measures::{Measures, Response, extent, regime_of};
use motor_hub::motor::Faults;
use motor_hub::record::Fault;
use serde::Serialize;
use serde_json::json;
use simulated::scenario::Scenario;
use simulated::scenario::expectation::{Expectation, Expected, Quantity, Subject, regime_name};
use simulated::trace::{Sample, Trace};
use std::fmt;
use std::ops::Range;

/// A measurement that needs this many decimals to show on which side of a limit it is, is written with all digits.
const MOST_DECIMALS: usize = 9;

/// An expectation and its measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The motor's or group's label, or "battery".
    pub subject: String,
    /// The expectation.
    pub expectation: Expectation,
    /// The value in the run.
    pub measured: Measured,
}

/// The measurement of an expectation.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Measured {
    /// Nothing was measured.
    Nothing,
    /// One number in the unit of the quantity; infinite if a motor never settled.
    Number(f64),
    /// Lowest and highest value, in the quantity's unit.
    Between(f64, f64),
    /// Words of every regime or fault that occurred.
    Words(Vec<&'static str>),
}

/// Judges every expectation of a scenario by a run of it, in the order of the file.
#[must_use]
pub fn judge(scenario: &Scenario, trace: &Trace) -> Vec<Verdict> {
    let verdict = |expectation: &Expectation| {
        let label = match expectation.subject {
            Subject::Motor(index) => scenario.motors.get(index).map(|motor| motor.label.clone()),
            Subject::Group(index) => scenario.groups.get(index).map(|group| group.label.clone()),
            Subject::Battery => Some("battery".to_owned()),
        };
        Verdict {
            subject: label.unwrap_or_default(),
            expectation: expectation.clone(),
            measured: measure(scenario, trace, expectation).unwrap_or(Measured::Nothing),
        }
    };
    scenario.expectations.iter().map(verdict).collect()
}

/// Measures the subject of an expectation; `None` if there is nothing to measure.
fn measure(scenario: &Scenario, trace: &Trace, expectation: &Expectation) -> Option<Measured> {
    let Expectation { subject, window_s, expected } = expectation;
    let number = match (*subject, expected) {
        (Subject::Motor(index), _) => return of_motor(scenario, trace, index, expectation),
        (Subject::Battery, _) => {
            let ticks = trace.ticks.iter().filter(|tick| window_s.contains(&tick.at_s));
            return extent(ticks.map(|tick| tick.battery_v)).map(|(low, high)| Measured::Between(low, high));
        }
        (Subject::Group(index), Expected::Quantity(Quantity::SettlingTime, _)) => {
            groups::longest_arrival_s(scenario.groups.get(index)?, trace, window_s)
        }
        (Subject::Group(index), Expected::Quantity(Quantity::HeadingError, _)) => {
            groups::largest_heading_error(scenario.groups.get(index)?, &scenario.motors, trace, window_s)
        }
        (Subject::Group(_), _) => None,
    };
    number.map(Measured::Number)
}

fn of_motor(scenario: &Scenario, trace: &Trace, index: usize, expectation: &Expectation) -> Option<Measured> {
    let window_s = &expectation.window_s;
    let motor = scenario.motors.get(index)?;
    let samples: Vec<&Sample> =
        trace.motor(index).filter(|(at, _)| window_s.contains(at)).map(|(_, sample)| sample).collect();
    if samples.is_empty() {
        return None;
    }
    let measures = Measures::new(motor, window_s.clone(), trace, index);
    let worst = |of: &dyn Fn(&Response) -> Option<f64>| {
        measures.responses.iter().filter_map(of).reduce(f64::max).map(Measured::Number)
    };
    let speeds = || extent(samples.iter().map(|sample| sample.speed_cps));
    Some(match expectation.expected {
        Expected::Quantity(quantity, _) => match quantity {
            Quantity::SettlingTime if measures.responses.iter().any(|response| response.too_short) => {
                return None;
            }
            Quantity::SettlingTime => worst(&|response| Some(response.settling_s.unwrap_or(f64::INFINITY)))?,
            Quantity::Overshoot => worst(&|response| response.overshoot_percent)?,
            Quantity::Speed => speeds().map(|(low, high)| Measured::Between(low, high))?,
            Quantity::Position => extent(samples.iter().map(|sample| sample.counts as f64))
                .map(|(low, high)| Measured::Between(low, high))?,
            Quantity::Swing => speeds().map(|(low, high)| Measured::Number(high - low))?,
            Quantity::CurrentStep => {
                // A motor that never slows down has no braking current.
                Some(measures.deceleration_jerk.worst_a).filter(|&step| step > 0.0).map(Measured::Number)?
            }
            Quantity::EnergyReturned => Measured::Number(measures.energy_to_battery_j),
            // These are quantities of a group and of the battery.
            Quantity::HeadingError | Quantity::Bus => return None,
        },
        Expected::Ever(_) | Expected::Never(_) => {
            Measured::Words(each_once(samples.iter().map(|sample| regime_name(regime_of(&sample.report)))))
        }
        Expected::Fault(_) => {
            Measured::Words(each_once(samples.iter().flat_map(|sample| fault_words(sample.report.faults))))
        }
    })
}

/// Each value once, in the order of first occurrence.
fn each_once<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut seen = Vec::new();
    for value in values {
        if !seen.contains(&value) {
            seen.push(value);
        }
    }
    seen
}

/// Words for the faults of a motor, the unknown battery first.
pub(crate) fn fault_words(faults: Faults) -> impl Iterator<Item = &'static str> {
    let all = [Fault::BatteryUnknown].iter().chain(Fault::ALL);
    all.filter(move |fault| fault.is_in(faults)).filter_map(|fault| fault.word())
}

impl Verdict {
    /// True if the measurement meets the expectation.
    #[must_use]
    pub fn met(&self) -> bool {
        match (self.expectation.expected, &self.measured) {
            (Expected::Quantity(_, [low, high]), &Measured::Number(value)) => low <= value && value <= high,
            (Expected::Quantity(_, [low, high]), &Measured::Between(least, most)) => {
                low <= least && most <= high
            }
            (Expected::Ever(regime), Measured::Words(seen)) => seen.contains(&regime_name(regime)),
            (Expected::Never(regime), Measured::Words(seen)) => !seen.contains(&regime_name(regime)),
            (Expected::Fault(wanted), Measured::Words(seen)) => {
                seen.iter().copied().eq(wanted.and_then(Fault::word))
            }
            _ => false,
        }
    }

    /// The measurement in words. A number has two decimals, or as many as show on which side of a limit the number is.
    pub(crate) fn measured_text(&self) -> String {
        let within = |value: f64| match self.expectation.expected {
            Expected::Quantity(_, [low, high]) => (low..=high).contains(&value),
            _ => true,
        };
        let number = |value: f64| {
            let mut texts = (2..MOST_DECIMALS).map(|decimals| format!("{value:.decimals$}"));
            let same_side = |text: &String| text.parse().is_ok_and(within) == within(value);
            texts.find(same_side).unwrap_or_else(|| value.to_string())
        };
        match &self.measured {
            Measured::Nothing => "nothing".to_owned(),
            Measured::Number(value) if value.is_infinite() => "never".to_owned(),
            Measured::Number(value) => number(*value),
            Measured::Between(low, high) => format!("{} to {}", number(*low), number(*high)),
            Measured::Words(words) if words.is_empty() => "none".to_owned(),
            Measured::Words(words) => words.join(", ").replace('_', " "),
        }
    }

    /// The verdict as JSON. `expected` is the key of a quantity in scenario files, which ends with the unit.
    pub fn json(&self) -> serde_json::Value {
        let Expectation { window_s, expected, .. } = &self.expectation;
        let (expected, wanted) = match *expected {
            Expected::Quantity(quantity, [low, high]) => (quantity.key(), json!([low, high])),
            Expected::Ever(regime) => ("ever", json!(regime_name(regime))),
            Expected::Never(regime) => ("never", json!(regime_name(regime))),
            Expected::Fault(fault) => ("fault", json!(fault.and_then(Fault::word))),
        };
        json!({
            "of": self.subject,
            "from_s": window_s.start,
            "to_s": window_s.end,
            "expected": expected,
            "wanted": wanted,
            "measured": self.measured,
            "met": self.met(),
        })
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { subject, expectation, .. } = self;
        let Expectation { window_s: Range { start, end }, expected, .. } = expectation;
        write!(f, "{subject}, {start} to {end} s: expected {expected}, measured {}", self.measured_text())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_measurement_is_rounded_only_as_far_as_it_stays_on_its_side_of_a_limit() {
        for (measured, limits, text) in [
            (12.3456, [0.0, 20.0], "12.35"),
            (0.50004, [0.0, 0.5], "0.50004"),
            (0.499_99, [0.5, 1.0], "0.49999"),
            (0.499_99, [0.0, 0.5], "0.50"),
            (0.5 + 1e-12, [0.0, 0.5], "0.500000000001"),
        ] {
            let expected = Expected::Quantity(Quantity::Swing, limits);
            let expectation = Expectation { subject: Subject::Motor(0), window_s: 0.0..1.0, expected };
            let verdict =
                Verdict { subject: String::new(), expectation, measured: Measured::Number(measured) };
            assert_eq!(verdict.measured_text(), text);
        }
    }
}
