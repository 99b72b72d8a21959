//! Reads a scenario file: its tables become a [`Scenario`]. The types in `numbers` check the range of each value. This
//! module checks rules between several keys.

mod expectations;
mod groups;
mod motors;

use super::error::{At, Checked, Fault};
use super::numbers::{
    AnalogVoltage, BatteryEmf, BatteryResistance, Duration, Name, PeriodMs, PinNumber, Seed, or, out_of_range,
};
use super::types::{Attached, Bus, Group, Scenario, Timed};
use crate::bno055::GyroErrors;
use crate::ground::Floor;
use crate::hardware::MOTORS;
use crate::i2c;
use expectations::ExpectTable;
use groups::GroupTable;
use motor_hub::board::{ANALOG_INPUTS, I2C_BUSES};
use motor_hub::model::{battery::Battery, si};
use motor_hub::protocol::pins::Pin;
use motor_hub::units::Period;
use motors::MotorTable;
use serde::Deserialize;
use std::collections::BTreeSet;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: Name,
    duration_s: Duration,
    control_period_ms: Option<PeriodMs>,
    seed: Option<Seed>,
    emulated: Option<Spanned<bool>>,
    battery: BatteryTable,
    bus: Option<Spanned<Bus>>,
    attached: Option<Spanned<AttachedTable>>,
    #[serde(default)]
    floor: Floor,
    #[serde(default)]
    gyro: GyroErrors,
    motors: Spanned<Vec<Spanned<MotorTable>>>,
    #[serde(default)]
    groups: Vec<Spanned<GroupTable>>,
    #[serde(default)]
    expect: Vec<Spanned<ExpectTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BatteryTable {
    emf_v: BatteryEmf,
    resistance_ohm: BatteryResistance,
    #[serde(default)]
    unlimited: bool,
    #[serde(default)]
    emf_over_time: Vec<Spanned<EmfTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EmfTable {
    at_s: f64,
    emf_v: BatteryEmf,
}

#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct AttachedTable {
    analog_v: Vec<AnalogVoltage>,
    low_pins: Option<Vec<PinNumber>>,
    i2c_faults: Vec<i2c::Fault>,
    over_time: Vec<Spanned<ChangeTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ChangeTable {
    at_s: f64,
    #[serde(default)]
    analog_v: Vec<AnalogVoltage>,
    low_pins: Option<Vec<PinNumber>>,
    #[serde(default)]
    i2c_faults: Vec<i2c::Fault>,
}

/// Reads and checks a whole file. If `is_complete` is true, every motor needs a set-point or a group.
pub(super) fn read(text: &str, is_complete: bool) -> Checked<Scenario> {
    let file: File = toml::from_str(text).map_err(|error| Fault::of_toml(&error, text))?;
    let duration_s = file.duration_s.0;
    let count = file.motors.get_ref().len();
    if !(1..=MOTORS).contains(&count) {
        return Err(format!("there are {count} motors; allowed are 1 to {MOTORS}")).at(&file.motors);
    }
    let motors = labelled(file.motors.get_ref(), |table| &table.label, |table| table.check(duration_s))?;
    let groups = labelled(&file.groups, |table| &table.label, |table| table.check(&motors, duration_s))?;
    file.check_gyro_bases(&groups)?;
    if is_complete {
        file.check_commanded(&groups)?;
    }
    let mut expectations = Vec::new();
    for table in &file.expect {
        expectations.extend(table.get_ref().check(&motors, &groups, duration_s).at(table)?);
    }
    if let Some(bus) = &file.bus {
        if file.battery.unlimited {
            return Err("a bus needs a battery with limits; remove unlimited").at(bus);
        }
        check_time("opens_at_s", bus.get_ref().opens_at_s, duration_s).at(bus)?;
    }
    let BatteryTable { emf_v, resistance_ohm, unlimited, emf_over_time } = &file.battery;
    let (attached, attached_over_time) = match &file.attached {
        Some(table) => table.get_ref().check(duration_s).at(table)?,
        None => Default::default(),
    };
    let scenario = Scenario {
        name: file.name.0,
        duration_s,
        period: file.control_period_ms.and_then(|ms| Period::from_millis(ms.0).ok()).unwrap_or_default(),
        seed: or(file.seed, 1_u32).into(),
        battery: Battery { emf: si::Volts(emf_v.0), resistance: si::Ohms(resistance_ohm.0) },
        bus: file.bus.map(Spanned::into_inner),
        unlimited: *unlimited,
        emf_over_time: timeline(emf_over_time, duration_s, |entry| (entry.at_s, Ok(entry.emf_v.0)))?,
        motors,
        groups,
        wire: None,
        attached,
        attached_over_time,
        floor: file.floor,
        gyro: file.gyro,
        emulated: file.emulated.as_ref().is_some_and(|emulated| *emulated.get_ref()),
        expectations,
    };
    if let Some(emulated) = file.emulated.filter(|emulated| *emulated.get_ref())
        && let Some(part) = scenario.not_replayed().next()
    {
        return Err(format!("the emulated board does not run {part}; remove emulated")).at(&emulated);
    }
    Ok(scenario)
}

impl File {
    /// Checks that all bases with a gyro are alike, because the hub has one drive base.
    fn check_gyro_bases(&self, groups: &[Group]) -> Checked<()> {
        let mut with_gyro = self.groups.iter().zip(groups).filter(|(_, group)| group.use_gyro);
        let Some((_, first)) = with_gyro.next() else { return Ok(()) };
        match with_gyro.find(|(_, group)| group.base != first.base) {
            Some((table, _)) => Err(format!(
                "the hub has one drive base with use_gyro, and the base of the group {:?} is another; give both the same values",
                first.label
            ))
            .at(table),
            None => Ok(()),
        }
    }

    /// Checks that every motor has a set-point of its own or a group.
    fn check_commanded(&self, groups: &[Group]) -> Checked<()> {
        for (index, table) in self.motors.get_ref().iter().enumerate() {
            let grouped = groups.iter().any(|group| group.motors.contains(&index));
            if table.get_ref().setpoints.is_empty() && !grouped {
                return Err("a motor needs at least one set-point, or a group").at(table);
            }
        }
        Ok(())
    }
}

impl AttachedTable {
    /// What is connected at the start, and the later changes.
    fn check(&self, duration_s: f64) -> Checked<(Attached, Vec<Timed<Attached>>)> {
        let changes = timeline(&self.over_time, duration_s, |change| {
            (change.at_s, attached(&change.analog_v, change.low_pins.as_deref(), &change.i2c_faults))
        })?;
        Ok((attached(&self.analog_v, self.low_pins.as_deref(), &self.i2c_faults)?, changes))
    }
}

/// Returns what is connected. Refuses more inputs or buses than the hub has.
fn attached(
    analog_v: &[AnalogVoltage],
    low_pins: Option<&[PinNumber]>,
    i2c_faults: &[i2c::Fault],
) -> Result<Attached, String> {
    for (key, count, most) in
        [("analog_v", analog_v.len(), ANALOG_INPUTS), ("i2c_faults", i2c_faults.len(), I2C_BUSES)]
    {
        if count > most {
            return Err(format!("{key} has {count} entries; allowed are at most {most}"));
        }
    }
    Ok(Attached {
        analog_v: analog_v.iter().map(|volts| volts.0).collect(),
        low_pins: low_pins.map(|pins| pins.iter().filter_map(|pin| Pin::new(pin.0)).collect()),
        i2c_faults: i2c_faults.to_vec(),
    })
}

/// Checks the tables of a list, and that their labels differ.
fn labelled<F, T>(
    tables: &[Spanned<F>],
    label: impl Fn(&F) -> &Name,
    check: impl Fn(&F) -> Checked<T>,
) -> Checked<Vec<T>> {
    let mut labels = BTreeSet::new();
    let mut checked = Vec::with_capacity(tables.len());
    for table in tables {
        checked.push(check(table.get_ref()).at(table)?);
        let Name(label) = label(table.get_ref());
        if !labels.insert(label) {
            return Err(format!("label {label:?} is used twice; labels must differ")).at(table);
        }
    }
    Ok(checked)
}

/// Checks a list by time: each entry is later than the entry before it, and all are within the run.
fn timeline<F, T>(
    entries: &[Spanned<F>],
    duration_s: f64,
    time_and_value: impl Fn(&F) -> (f64, Result<T, String>),
) -> Checked<Vec<Timed<T>>> {
    let mut timed: Vec<Timed<T>> = Vec::with_capacity(entries.len());
    for entry in entries {
        let (at_s, value) = time_and_value(entry.get_ref());
        // NaN is refused too, because no range contains it.
        let value = if !(0.0..=duration_s).contains(&at_s) {
            Err(format!("at_s = {at_s} is outside the run; allowed is 0 to {duration_s}"))
        } else if let Some(last) = timed.last().filter(|last| last.at_s >= at_s) {
            Err(format!("at_s = {at_s} is not after {}; times must ascend", last.at_s))
        } else {
            value
        };
        timed.push(Timed { at_s, value: value.at(entry)? });
    }
    Ok(timed)
}

/// Checks that a time lies within the run.
fn check_time(key: &str, at_s: Option<f64>, duration_s: f64) -> Result<(), String> {
    match at_s.filter(|at_s| !(0.0..=duration_s).contains(at_s)) {
        Some(at_s) => Err(out_of_range(key, at_s, 0.0..=duration_s)),
        None => Ok(()),
    }
}

/// Index of a label among the labels of motors or groups.
fn find<'a>(
    what: &str,
    label: &Spanned<String>,
    known: impl Iterator<Item = &'a String> + Clone,
) -> Checked<usize> {
    let given = label.get_ref();
    let index = known.clone().position(|other| other == given.trim()).ok_or_else(|| {
        let labels: Vec<&str> = known.map(String::as_str).collect();
        if labels.is_empty() {
            return format!("no {what} has the label {given:?}; the scenario has no {what}s");
        }
        format!("no {what} has the label {given:?}; labels are {}", labels.join(", "))
    });
    index.at(label)
}
