//! Reads a scenario file: its tables become a [`Scenario`]. A kind of number checks its own range; what depends on
//! several keys is checked here.

mod expectations;
mod groups;
mod motors;
mod numbers;

use super::error::{At, Checked, Fault};
use super::types::{Attached, Bus, Group, Motor, Scenario, Timed, UNLIMITED};
use crate::bno055::GyroErrors;
use crate::ground::Floor;
use crate::hardware::MOTORS;
use crate::i2c;
use expectations::ExpectTable;
use groups::GroupTable;
use motor_hub::board::{ANALOG_INPUTS, I2C_BUSES};
use motor_hub::model::{battery::Battery, si};
use motor_hub::protocol::pins::Pin;
use motor_hub::supply::{Levels, Limits};
use motor_hub::units::{Millivolts, Period};
use motors::MotorTable;
use numbers::{
    AnalogVoltage, BatteryEmf, BatteryResistance, Capacitance, Course as Way, Drift, Duration, Length, Name,
    PeriodMs, PinNumber, ScaleError, Seed, Slip, or, out_of_range,
};
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: Name,
    duration_s: Duration,
    control_period_ms: Option<PeriodMs>,
    seed: Option<Seed>,
    #[serde(default)]
    emulated: bool,
    battery: BatteryTable,
    bus: Option<Spanned<BusTable>>,
    attached: Option<Spanned<AttachedTable>>,
    floor: Option<FloorTable>,
    gyro: Option<GyroTable>,
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct AttachedTable {
    #[serde(default)]
    analog_v: Vec<AnalogVoltage>,
    low_pins: Option<Vec<PinNumber>>,
    #[serde(default)]
    i2c_faults: Vec<i2c::Fault>,
    #[serde(default)]
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FloorTable {
    wheel_diameters_mm: Option<[Way; 2]>,
    track_mm: Option<Length>,
    slip_in_turns: Option<Slip>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GyroTable {
    drift_degrees_per_min: Option<Drift>,
    scale_error: Option<ScaleError>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BusTable {
    capacitance_f: Capacitance,
    #[serde(default)]
    one_way: bool,
    opens_at_s: Option<f64>,
    burn_between_v: Option<[f64; 2]>,
}

/// Reads and checks a whole file. A complete one has a set-point or a course for every motor.
pub(super) fn read(text: &str, is_complete: bool) -> Checked<Scenario> {
    let file: File = toml::from_str(text).map_err(|error| Fault::of_toml(&error, text))?;
    let duration_s = file.duration_s.0;
    let motors = file.motors(duration_s)?;
    let groups = file.groups(&motors, duration_s)?;
    if is_complete {
        file.check_commanded(&groups)?;
    }
    file.check_emulated()?;
    let mut expectations = Vec::new();
    for table in &file.expect {
        expectations.extend(table.get_ref().check(&motors, &groups, duration_s).at(table)?);
    }
    let battery = file.battery;
    let (bus, limits) = match &file.bus {
        Some(table) if battery.unlimited => {
            return Err("a bus needs a battery with limits; remove unlimited".to_owned()).at(table);
        }
        Some(table) => {
            let (bus, limits) = table.get_ref().check(duration_s).at(table)?;
            (Some(bus), limits)
        }
        None if battery.unlimited => (None, UNLIMITED),
        None => (None, Limits::TWELVE_VOLTS),
    };
    Ok(Scenario {
        name: file.name.0,
        duration_s,
        period: file.control_period_ms.and_then(|ms| Period::from_millis(ms.0).ok()).unwrap_or_default(),
        seed: or(file.seed, 1_u32).into(),
        battery: Battery { emf: si::Volts(battery.emf_v.0), resistance: si::Ohms(battery.resistance_ohm.0) },
        bus,
        limits,
        emf_over_time: timeline(&battery.emf_over_time, duration_s, |t| t.at_s, |t| Ok(t.emf_v.0))?,
        motors,
        groups,
        wire: None,
        attached: match &file.attached {
            Some(whole) => {
                let table = whole.get_ref();
                attached(&table.analog_v, table.low_pins.as_deref(), &table.i2c_faults).at(whole)?
            }
            None => Attached::default(),
        },
        attached_over_time: match &file.attached {
            Some(whole) => timeline(
                &whole.get_ref().over_time,
                duration_s,
                |t| t.at_s,
                |t| attached(&t.analog_v, t.low_pins.as_deref(), &t.i2c_faults),
            )?,
            None => Vec::new(),
        },
        floor: file.floor.as_ref().map(FloorTable::floor).unwrap_or_default(),
        gyro: file.gyro.as_ref().map(GyroTable::errors).unwrap_or_default(),
        emulated: file.emulated,
        expectations,
    })
}

impl File {
    fn motors(&self, duration_s: f64) -> Checked<Vec<Motor>> {
        let count = self.motors.get_ref().len();
        if !(1..=MOTORS).contains(&count) {
            return Err(format!("there are {count} motors; allowed are 1 to {MOTORS}")).at(&self.motors);
        }
        let mut motors: Vec<Motor> = Vec::with_capacity(count);
        for table in self.motors.get_ref() {
            let motor = table.get_ref().check(table, duration_s)?;
            unused(&motor.label, motors.iter().map(|other| &other.label)).at(table)?;
            motors.push(motor);
        }
        Ok(motors)
    }

    fn groups(&self, motors: &[Motor], duration_s: f64) -> Checked<Vec<Group>> {
        let mut groups: Vec<Group> = Vec::with_capacity(self.groups.len());
        for table in &self.groups {
            let group = table.get_ref().check(table, motors, duration_s)?;
            unused(&group.label, groups.iter().map(|other| &other.label)).at(table)?;
            groups.push(group);
        }
        Ok(groups)
    }

    /// Every motor has a set-point of its own or a group.
    fn check_commanded(&self, groups: &[Group]) -> Checked<()> {
        for (index, table) in self.motors.get_ref().iter().enumerate() {
            let grouped = groups.iter().any(|group| group.motors.contains(&index));
            if table.get_ref().setpoints.is_empty() && !grouped {
                return Err("a motor needs at least one set-point, or a group".to_owned()).at(table);
            }
        }
        Ok(())
    }

    /// The emulated chip does not report groups. Its bench has neither a bus nor a train.
    fn check_emulated(&self) -> Checked<()> {
        let mut trains = self.motors.get_ref().iter().filter_map(|motor| motor.get_ref().train.as_ref());
        if let (true, Some(train)) = (self.emulated, trains.next()) {
            return Err("a train does not run on the emulated chip; remove emulated".to_owned()).at(train);
        }
        match (self.groups.first(), &self.bus) {
            (Some(group), _) if self.emulated => {
                Err("groups do not run on the emulated chip; remove emulated".to_owned()).at(group)
            }
            (_, Some(bus)) if self.emulated => {
                Err("a bus does not run on the emulated chip; remove emulated".to_owned()).at(bus)
            }
            _ => Ok(()),
        }
    }
}

/// What is connected, if the hub has all these inputs and buses.
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

impl FloorTable {
    fn floor(&self) -> Floor {
        let usual = Floor::default();
        Floor {
            wheel_diameters_mm: self
                .wheel_diameters_mm
                .map_or(usual.wheel_diameters_mm, |mm| mm.map(|mm| mm.0)),
            track_mm: or(self.track_mm, usual.track_mm),
            slip_in_turns: or(self.slip_in_turns, usual.slip_in_turns),
        }
    }
}

impl GyroTable {
    fn errors(&self) -> GyroErrors {
        GyroErrors {
            drift_degrees_per_min: or(self.drift_degrees_per_min, 0.0),
            scale_error: or(self.scale_error, 0.0),
        }
    }
}

impl BusTable {
    /// The bus, and the hub's own limits with the dissipation levels of the table.
    fn check(&self, duration_s: f64) -> Result<(Bus, Limits), String> {
        let opens_at_s = self.opens_at_s;
        if let Some(at_s) = opens_at_s.filter(|at_s| !(0.0..=duration_s).contains(at_s)) {
            return Err(out_of_range("opens_at_s", at_s, 0.0..=duration_s));
        }
        let bus = Bus { capacitance_f: self.capacitance_f.0, one_way: self.one_way, opens_at_s };
        let limits = Limits::TWELVE_VOLTS;
        let Some(between) = self.burn_between_v else { return Ok((bus, limits)) };
        let limits = match between.map(Millivolts::from_volts) {
            [Ok(dissipate), Ok(ceiling)] => {
                Limits::new(Levels { dissipate, ceiling, ..limits.levels() }).ok()
            }
            _ => None,
        };
        let Levels { recover, max, .. } = Limits::TWELVE_VOLTS.levels();
        let limits = limits.ok_or_else(|| {
            format!(
                "burn_between_v = {between:?} is out of range; it needs [low, high] with low above {} V, below high, \
                 and high up to {} V",
                recover.to_volts(),
                max.to_volts()
            )
        })?;
        Ok((bus, limits))
    }
}

/// Checks a list by time: each entry is later than the entry before it, and all are within the run.
fn timeline<F, T>(
    entries: &[Spanned<F>],
    duration_s: f64,
    at_s: impl Fn(&F) -> f64,
    value: impl Fn(&F) -> Result<T, String>,
) -> Checked<Vec<Timed<T>>> {
    let mut timed: Vec<Timed<T>> = Vec::with_capacity(entries.len());
    for entry in entries {
        let at_s = at_s(entry.get_ref());
        // Not a number is not within the run either.
        let message = if !(0.0..=duration_s).contains(&at_s) {
            Err(format!("at_s = {at_s} is outside the run; allowed is 0 to {duration_s}"))
        } else if let Some(last) = timed.last().filter(|last| last.at_s >= at_s) {
            Err(format!("at_s = {at_s} is not after {}; times must ascend", last.at_s))
        } else {
            value(entry.get_ref())
        };
        timed.push(Timed { at_s, value: message.at(entry)? });
    }
    Ok(timed)
}

/// Labels of a list differ.
fn unused<'a>(label: &String, mut others: impl Iterator<Item = &'a String>) -> Result<(), String> {
    if others.any(|other| other == label) {
        return Err(format!("label {label:?} is used twice; labels must differ"));
    }
    Ok(())
}

/// Index of a label among the labels of motors or groups.
fn find<'a>(
    what: &str,
    label: &str,
    known: impl Iterator<Item = &'a String> + Clone,
) -> Result<usize, String> {
    known.clone().position(|other| other == label.trim()).ok_or_else(|| {
        let known: Vec<&str> = known.map(String::as_str).collect();
        format!("no {what} has the label {label:?}; labels are {}", known.join(", "))
    })
}
