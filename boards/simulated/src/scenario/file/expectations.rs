//! The tables `[[expect]]`: each has a motor or a group, a window, and one quantity or several.

use super::find;
use super::numbers::{
    BusVoltage, Degrees, Energy, PositionBound, SettlingTime, SpeedBound, Swing, UpTo1000, out_of_range,
};
use crate::scenario::expectation::{Bounds, Expectation, Expected, Quantity, Subject, regime_name};
use crate::scenario::types::{Group, Motor};
use motor_hub::braking::Regime;
use motor_hub::record::Fault;
use serde::Deserialize;
use std::ops::Range;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExpectTable {
    motor: Option<String>,
    group: Option<String>,
    from_s: Option<f64>,
    to_s: Option<f64>,
    settles_within_s: Option<SettlingTime>,
    overshoot_below_percent: Option<UpTo1000>,
    speed_between_cps: Option<[SpeedBound; 2]>,
    position_between_counts: Option<[PositionBound; 2]>,
    swing_between_cps: Option<[Swing; 2]>,
    current_step_below_a: Option<UpTo1000>,
    energy_returned_between_j: Option<[Energy; 2]>,
    heading_error_below_degrees: Option<Degrees>,
    bus_between_v: Option<[BusVoltage; 2]>,
    #[serde(default)]
    ever: Vec<RegimeWord>,
    #[serde(default)]
    never: Vec<RegimeWord>,
    fault: Option<FaultWord>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum FaultWord {
    None,
    Stuck,
    Reversed,
}

/// A regime by its name.
#[derive(Clone, Copy, Deserialize)]
#[serde(try_from = "String")]
struct RegimeWord(Option<Regime>);

impl TryFrom<String> for RegimeWord {
    type Error = String;

    fn try_from(word: String) -> Result<Self, String> {
        let all = [Some(Regime::Forward), Some(Regime::Braking), Some(Regime::Reverse), None];
        let regime = all.into_iter().find(|&regime| regime_name(regime) == word);
        let names = || all.map(|regime| format!("`{}`", regime_name(regime))).join(", ");
        regime.map(Self).ok_or_else(|| format!("unknown variant `{word}`, expected one of {}", names()))
    }
}

impl ExpectTable {
    /// All expectations of the table, for each of its motors.
    pub(super) fn check(
        &self,
        motors: &[Motor],
        groups: &[Group],
        duration_s: f64,
    ) -> Result<Vec<Expectation>, String> {
        let window_s = self.window(duration_s)?;
        let of_motors = self.of_motors()?;
        let battery = between(self.bus_between_v, Quantity::Bus)?;
        let heading = below(self.heading_error_below_degrees, Quantity::HeadingError);
        if of_motors.is_empty() && battery.is_none() && heading.is_none() {
            return Err("an expectation needs at least one key of a motor, a group or the battery".to_owned());
        }
        let mut wanted = Vec::new();
        if let Some(label) = &self.group {
            let index = find("group", label, groups.iter().map(|group| &group.label))?;
            let settling =
                |expected: &Expected| matches!(expected, Expected::Quantity(Quantity::SettlingTime, _));
            if self.motor.is_some() {
                return Err("an expectation has a motor or a group, not both".to_owned());
            }
            if battery.is_some() || !of_motors.iter().all(settling) {
                return Err(
                    "an expectation of a group allows settles_within_s and heading_error_below_degrees only"
                        .to_owned(),
                );
            }
            if heading.is_some() && groups.get(index).is_none_or(|group| group.base.is_none()) {
                return Err(HEADING_OF_BASE.to_owned());
            }
            wanted.extend(
                of_motors.into_iter().chain(heading).map(|expected| (Subject::Group(index), expected)),
            );
        } else {
            if heading.is_some() {
                return Err(HEADING_OF_BASE.to_owned());
            }
            let subjects = match &self.motor {
                Some(label) => {
                    let index = find("motor", label, motors.iter().map(|motor| &motor.label))?;
                    index..index + 1
                }
                None => 0..motors.len(),
            };
            if battery.is_some() && self.motor.is_some() {
                return Err("bus_between_v is about the battery; remove motor".to_owned());
            }
            for motor in subjects {
                wanted.extend(of_motors.iter().map(|&expected| (Subject::Motor(motor), expected)));
            }
            wanted.extend(battery.map(|expected| (Subject::Battery, expected)));
        }
        let expectation = |(subject, expected)| Expectation { subject, window_s: window_s.clone(), expected };
        Ok(wanted.into_iter().map(expectation).collect())
    }

    /// The window of the table, by default the whole run.
    fn window(&self, duration_s: f64) -> Result<Range<f64>, String> {
        for (key, at_s) in [("from_s", self.from_s), ("to_s", self.to_s)] {
            if let Some(at_s) = at_s.filter(|at_s| !(0.0..=duration_s).contains(at_s)) {
                return Err(out_of_range(key, at_s, 0.0..=duration_s));
            }
        }
        let window = self.from_s.unwrap_or(0.0)..self.to_s.unwrap_or(duration_s);
        if window.is_empty() {
            return Err("from_s must be less than to_s; the window without both is the whole run".to_owned());
        }
        Ok(window)
    }

    fn of_motors(&self) -> Result<Vec<Expected>, String> {
        let quantities = [
            below(self.settles_within_s, Quantity::SettlingTime),
            below(self.overshoot_below_percent, Quantity::Overshoot),
            between(self.speed_between_cps, Quantity::Speed)?,
            between(self.position_between_counts, Quantity::Position)?,
            between(self.swing_between_cps, Quantity::Swing)?,
            below(self.current_step_below_a, Quantity::CurrentStep),
            between(self.energy_returned_between_j, Quantity::EnergyReturned)?,
        ];
        let ever = self.ever.iter().map(|regime| Expected::Ever(regime.0));
        let regimes = ever.chain(self.never.iter().map(|regime| Expected::Never(regime.0)));
        let fault = self.fault.map(|word| {
            Expected::Fault(match word {
                FaultWord::None => None,
                FaultWord::Stuck => Some(Fault::EncoderStuck),
                FaultWord::Reversed => Some(Fault::EncoderReversed),
            })
        });
        Ok(quantities.into_iter().flatten().chain(regimes).chain(fault).collect())
    }
}

const HEADING_OF_BASE: &str = "heading_error_below_degrees needs a group with a base";

fn below(high: Option<impl Into<f64>>, quantity: Quantity) -> Option<Expected> {
    high.map(|high| Expected::Quantity(quantity, Bounds { low: 0.0, high: high.into() }))
}

fn between(ends: Option<[impl Into<f64>; 2]>, quantity: Quantity) -> Result<Option<Expected>, String> {
    let Some([low, high]) = ends.map(|ends| ends.map(Into::into)) else { return Ok(None) };
    if low > high {
        return Err(format!(
            "{} = [{low}, {high}] is refused; it needs [low, high] with low at most high",
            quantity.key()
        ));
    }
    Ok(Some(Expected::Quantity(quantity, Bounds { low, high })))
}
