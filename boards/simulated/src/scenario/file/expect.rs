//! The tables `[[expect]]`: each has a motor or a group, a window, and one quantity or several.

use super::ranges::{FASTEST_CPS, within};
use crate::scenario::definition::{Group, LONGEST_S, Motor};
use crate::scenario::expectation::{Bounds, Expectation, Quantity, RegimeName, Subject, Wish};
use crate::scenario::mistake::{Checked, Mistake, fault};
use motor_hub::motor::EncoderFault;
use serde::Deserialize;
use std::ops::{Range, RangeInclusive};
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ExpectTable {
    motor: Option<Spanned<String>>,
    group: Option<Spanned<String>>,
    from_s: Option<Spanned<f64>>,
    to_s: Option<Spanned<f64>>,
    settles_within_s: Option<Spanned<f64>>,
    overshoot_below_percent: Option<Spanned<f64>>,
    speed_between_cps: Option<Spanned<[f64; 2]>>,
    position_between_counts: Option<Spanned<[f64; 2]>>,
    swing_between_cps: Option<Spanned<[f64; 2]>>,
    current_step_below_a: Option<Spanned<f64>>,
    energy_returned_between_j: Option<Spanned<[f64; 2]>>,
    heading_error_below_degrees: Option<Spanned<f64>>,
    bus_between_v: Option<Spanned<[f64; 2]>>,
    #[serde(default)]
    ever: Vec<RegimeName>,
    #[serde(default)]
    never: Vec<RegimeName>,
    fault: Option<FaultWord>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum FaultWord {
    None,
    Stuck,
    Reversed,
}

const SPEED: RangeInclusive<f64> = -(FASTEST_CPS as f64)..=FASTEST_CPS as f64;
const SWING: RangeInclusive<f64> = 0.0..=2.0 * FASTEST_CPS as f64;
const POSITION: RangeInclusive<f64> = i32::MIN as f64..=i32::MAX as f64;
const PERCENT: RangeInclusive<f64> = 0.0..=1000.0;
const CURRENT: RangeInclusive<f64> = 0.0..=1000.0;
const ENERGY: RangeInclusive<f64> = 0.0..=1e6;
const DEGREES: RangeInclusive<f64> = 0.0..=360.0;
const BUS: RangeInclusive<f64> = 0.0..=100.0;

impl ExpectTable {
    /// All expectations of the table, for each of its motors.
    pub(super) fn check(
        &self,
        whole: &Spanned<Self>,
        motors: &[Motor],
        groups: &[Group],
        duration_s: f64,
    ) -> Checked<Vec<Expectation>> {
        let window_s = self.window(whole, duration_s)?;
        if let Some(label) = &self.group {
            let group = self.group(label, groups)?;
            let wishes = self.of_group(whole, label)?;
            let expectation =
                |wish| Expectation { subject: Subject::Group(group), window_s: window_s.clone(), wish };
            return Ok(wishes.into_iter().map(expectation).collect());
        }
        if let Some(heading) = &self.heading_error_below_degrees {
            return Err(fault(heading, Mistake::HeadingOfBase));
        }
        let of_motors = self.of_motors()?;
        let of_battery = between(&self.bus_between_v, Quantity::Bus, BUS)?;
        if of_motors.is_empty() && of_battery.is_none() {
            return Err(fault(whole, Mistake::ExpectsNothing));
        }
        let subjects = self.subjects(motors)?;
        if let (Some(bus), Some(_)) = (&self.bus_between_v, &self.motor) {
            return Err(fault(bus, Mistake::BusOfMotor));
        }
        let motors = subjects
            .into_iter()
            .flat_map(|motor| of_motors.iter().map(move |&wish| (Subject::Motor(motor), wish)));
        let battery = of_battery.map(|wish| (Subject::Battery, wish));
        let expectation = |(subject, wish)| Expectation { subject, window_s: window_s.clone(), wish };
        Ok(motors.chain(battery).map(expectation).collect())
    }

    /// The window of the table, by default the whole run.
    fn window(&self, whole: &Spanned<Self>, duration_s: f64) -> Checked<Range<f64>> {
        let end = |given: &Option<Spanned<f64>>, key, absent| {
            given.as_ref().map_or(Ok(absent), |at| within(at, key, 0.0..=duration_s))
        };
        let window = end(&self.from_s, "from_s", 0.0)?..end(&self.to_s, "to_s", duration_s)?;
        if window.is_empty() { Err(fault(whole, Mistake::EmptyWindow)) } else { Ok(window) }
    }

    /// The motor of the label, or all.
    fn subjects(&self, motors: &[Motor]) -> Checked<Vec<usize>> {
        let Some(label) = &self.motor else { return Ok((0..motors.len()).collect()) };
        let found = motors.iter().position(|motor| motor.label == label.get_ref().trim());
        found.map(|index| vec![index]).ok_or_else(|| {
            let known = motors.iter().map(|motor| motor.label.clone()).collect();
            fault(label, Mistake::NoSuchLabel { label: label.get_ref().clone(), known })
        })
    }

    /// The group of the label, checked for the expected quantities.
    fn group(&self, label: &Spanned<String>, groups: &[Group]) -> Checked<usize> {
        if self.motor.is_some() {
            return Err(fault(label, Mistake::MotorAndGroup));
        }
        let index =
            groups.iter().position(|group| group.label == label.get_ref().trim()).ok_or_else(|| {
                let known = groups.iter().map(|group| group.label.clone()).collect();
                fault(label, Mistake::NoSuchGroup { label: label.get_ref().clone(), known })
            })?;
        match &self.heading_error_below_degrees {
            Some(heading) if groups.get(index).is_none_or(|group| group.base.is_none()) => {
                Err(fault(heading, Mistake::HeadingOfBase))
            }
            _ => Ok(index),
        }
    }

    /// The expectations of a group: settling and heading.
    fn of_group(&self, whole: &Spanned<Self>, label: &Spanned<String>) -> Checked<Vec<Wish>> {
        let of_motors = self.of_motors()?;
        let settling = |wish: &Wish| matches!(wish, Wish::Quantity(Quantity::SettlingTime, _));
        if self.bus_between_v.is_some() || !of_motors.iter().all(settling) {
            return Err(fault(label, Mistake::NotOfGroup));
        }
        let heading = below(&self.heading_error_below_degrees, Quantity::HeadingError, DEGREES)?;
        let wishes: Vec<Wish> = of_motors.into_iter().chain(heading).collect();
        if wishes.is_empty() { Err(fault(whole, Mistake::ExpectsNothing)) } else { Ok(wishes) }
    }

    fn of_motors(&self) -> Checked<Vec<Wish>> {
        let quantities = [
            below(&self.settles_within_s, Quantity::SettlingTime, 0.0..=LONGEST_S)?,
            below(&self.overshoot_below_percent, Quantity::Overshoot, PERCENT)?,
            between(&self.speed_between_cps, Quantity::Speed, SPEED)?,
            between(&self.position_between_counts, Quantity::Position, POSITION)?,
            between(&self.swing_between_cps, Quantity::Swing, SWING)?,
            below(&self.current_step_below_a, Quantity::CurrentStep, CURRENT)?,
            between(&self.energy_returned_between_j, Quantity::EnergyReturned, ENERGY)?,
        ];
        let regimes =
            self.ever.iter().copied().map(Wish::Ever).chain(self.never.iter().copied().map(Wish::Never));
        let fault = self.fault.map(|word| {
            Wish::Fault(match word {
                FaultWord::None => None,
                FaultWord::Stuck => Some(EncoderFault::Stuck),
                FaultWord::Reversed => Some(EncoderFault::Reversed),
            })
        });
        Ok(quantities.into_iter().flatten().chain(regimes).chain(fault).collect())
    }
}

fn below(
    given: &Option<Spanned<f64>>,
    quantity: Quantity,
    range: RangeInclusive<f64>,
) -> Checked<Option<Wish>> {
    let bounds = |high: &Spanned<f64>| Ok(Bounds { low: 0.0, high: within(high, quantity.key(), range)? });
    Ok(given.as_ref().map(bounds).transpose()?.map(|bounds| Wish::Quantity(quantity, bounds)))
}

fn between(
    given: &Option<Spanned<[f64; 2]>>,
    quantity: Quantity,
    range: RangeInclusive<f64>,
) -> Checked<Option<Wish>> {
    let Some(pair) = given else { return Ok(None) };
    let ends =
        pair.get_ref().map(|end| within(&Spanned::new(pair.span(), end), quantity.key(), range.clone()));
    let [low, high] = ends;
    let bounds = Bounds { low: low?, high: high? };
    if bounds.low > bounds.high {
        return Err(fault(pair, Mistake::LowAboveHigh(quantity.key())));
    }
    Ok(Some(Wish::Quantity(quantity, bounds)))
}
