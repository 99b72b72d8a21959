//! The tables `[[expect]]`. Each has a motor, a group or neither, a window, and one or more expectations. Without a
//! motor and a group, the expectations are about every motor or about the battery.

use super::{check_time, find};
use crate::scenario::error::Checked;
use crate::scenario::expectation::{Expectation, Expected, Quantity, Subject, regime_name};
use crate::scenario::numbers::{
    BusVoltage, Degrees, Energy, PositionBound, SettlingTime, SpeedBound, Swing, UpTo1000, one_of,
};
use crate::scenario::types::{Group, Motor};
use motor_hub::braking::Regime;
use motor_hub::record::Fault;
use serde::{Deserialize, Deserializer};
use std::ops::Range;
use toml::Spanned;

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(super) struct ExpectTable {
    motor: Option<Spanned<String>>,
    group: Option<Spanned<String>>,
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
    ever: Vec<RegimeWord>,
    never: Vec<RegimeWord>,
    #[serde(deserialize_with = "fault")]
    fault: Option<Expected>,
}

/// A regime by its name; `None` for an open bridge.
#[derive(Clone, Copy)]
struct RegimeWord(Option<Regime>);

impl<'de> Deserialize<'de> for RegimeWord {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let regimes = [Some(Regime::Forward), Some(Regime::Braking), Some(Regime::Reverse), None];
        one_of(from, &regimes.map(|regime| (regime_name(regime), Self(regime))))
    }
}

fn fault<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Expected>, D::Error> {
    let faults =
        [("none", None), ("stuck", Some(Fault::EncoderStuck)), ("reversed", Some(Fault::EncoderReversed))];
    one_of(from, &faults).map(|fault| Some(Expected::Fault(fault)))
}

impl ExpectTable {
    /// All expectations of the table, for each of its motors.
    pub(super) fn check(
        &self,
        motors: &[Motor],
        groups: &[Group],
        duration_s: f64,
    ) -> Checked<Vec<Expectation>> {
        let window_s = self.window(duration_s)?;
        let mut expectations = Vec::new();
        for expected in self.expected()? {
            let subjects = self.subjects(&expected, motors, groups)?;
            expectations.extend(subjects.into_iter().map(|subject| Expectation {
                subject,
                window_s: window_s.clone(),
                expected,
            }));
        }
        if expectations.is_empty() {
            return Err("an expectation needs at least one key of a motor, a group or the battery".into());
        }
        // All expectations of a motor follow each other.
        expectations.sort_by_key(|expectation| expectation.subject);
        Ok(expectations)
    }

    /// The subjects that an expected quantity, regime or fault of the table is about.
    fn subjects(&self, expected: &Expected, motors: &[Motor], groups: &[Group]) -> Checked<Vec<Subject>> {
        let quantity = match expected {
            Expected::Quantity(quantity, _) => Some(quantity),
            _ => None,
        };
        let subjects = match (&self.motor, &self.group) {
            (Some(_), Some(_)) => return Err("an expectation has a motor or a group, not both".into()),
            (None, Some(label)) => {
                let index = find("group", label, groups.iter().map(|group| &group.label))?;
                let has_base = groups.get(index).is_some_and(|group| group.base.is_some());
                match quantity {
                    Some(Quantity::HeadingError) if !has_base => return Err(HEADING_OF_BASE.into()),
                    Some(Quantity::SettlingTime | Quantity::HeadingError) => vec![Subject::Group(index)],
                    _ => return Err(OF_GROUPS.into()),
                }
            }
            _ if quantity == Some(&Quantity::HeadingError) => return Err(HEADING_OF_BASE.into()),
            (Some(_), None) if quantity == Some(&Quantity::Bus) => {
                return Err("bus_between_v is about the battery; remove motor".into());
            }
            (Some(label), None) => {
                vec![Subject::Motor(find("motor", label, motors.iter().map(|motor| &motor.label))?)]
            }
            (None, None) if quantity == Some(&Quantity::Bus) => vec![Subject::Battery],
            (None, None) => (0..motors.len()).map(Subject::Motor).collect(),
        };
        Ok(subjects)
    }

    /// The window of the table, by default the whole run.
    fn window(&self, duration_s: f64) -> Result<Range<f64>, String> {
        check_time("from_s", self.from_s, duration_s)?;
        check_time("to_s", self.to_s, duration_s)?;
        let window = self.from_s.unwrap_or(0.0)..self.to_s.unwrap_or(duration_s);
        if window.is_empty() {
            return Err("from_s must be less than to_s; the window without both is the whole run".to_owned());
        }
        Ok(window)
    }

    /// Everything that the table expects.
    fn expected(&self) -> Result<Vec<Expected>, String> {
        let quantities = [
            below(self.settles_within_s, Quantity::SettlingTime),
            below(self.overshoot_below_percent, Quantity::Overshoot),
            between(self.speed_between_cps, Quantity::Speed)?,
            between(self.position_between_counts, Quantity::Position)?,
            between(self.swing_between_cps, Quantity::Swing)?,
            below(self.current_step_below_a, Quantity::CurrentStep),
            between(self.energy_returned_between_j, Quantity::EnergyReturned)?,
            below(self.heading_error_below_degrees, Quantity::HeadingError),
            between(self.bus_between_v, Quantity::Bus)?,
        ];
        let ever = self.ever.iter().map(|regime| Expected::Ever(regime.0));
        let never = self.never.iter().map(|regime| Expected::Never(regime.0));
        Ok(quantities.into_iter().flatten().chain(ever).chain(never).chain(self.fault).collect())
    }
}

/// Message for an expected heading error without a drive base.
const HEADING_OF_BASE: &str = "heading_error_below_degrees needs a group with a base";
/// Message for a quantity that a group does not have.
const OF_GROUPS: &str =
    "an expectation of a group allows settles_within_s and heading_error_below_degrees only";

fn below(high: Option<impl Into<f64>>, quantity: Quantity) -> Option<Expected> {
    high.map(|high| Expected::Quantity(quantity, [0.0, high.into()]))
}

fn between(ends: Option<[impl Into<f64>; 2]>, quantity: Quantity) -> Result<Option<Expected>, String> {
    let Some([low, high]) = ends.map(|ends| ends.map(Into::into)) else { return Ok(None) };
    if low > high {
        return Err(format!(
            "{} = [{low}, {high}] is refused; it needs [low, high] with low at most high",
            quantity.key()
        ));
    }
    Ok(Some(Expected::Quantity(quantity, [low, high])))
}
