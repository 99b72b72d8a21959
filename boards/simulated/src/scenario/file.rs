//! Reads a scenario file: from its tables, by checks, to a [`Scenario`].

mod bus;
mod constants;
mod encoders;
mod expect;
mod friction;
mod groups;
mod ranges;
mod tables;
mod train;

use super::definition::{
    Configuration, ConfiguredMotion, Group, LONGEST_S, Motor, Scenario, Timed, UNLIMITED,
};
use super::mistake::{Checked, Fault, Mistake, fault};
use crate::current_line::CurrentLine;
use crate::hardware::{BRIDGE, MOTORS, REAL_BRIDGE, thermal_limit};
use crate::scheme::SchemeName;
use encoders::check as check_encoder;
use motor_hub::model::catalogue::{self, characterised};
use motor_hub::model::{battery::Battery, load::Load, si};
use motor_hub::motion::Pidf;
use motor_hub::motor::{OnFault, Setpoint, ThermalLimit, ZeroPower};
use motor_hub::supply::Limits;
use motor_hub::units::{Acceleration, Coefficient, Control, CountsPerSecond, Milliamperes, Period};
use ranges::{FASTEST_CPS, HARDEST_CPS2, Whole, named, optional, timeline, within};
use std::num::NonZeroU16;
use std::ops::RangeInclusive;
use tables::{
    BridgeWord, CurrentLineWord, File, GainTable, Inertia, MotorTable, OnFaultWord, SetPointTable,
    ToldChoice, ToldTable, ZeroPowerWord,
};
use toml::Spanned;

/// Largest current of a set-point or of a limit, in amperes.
const LARGEST_A: f64 = 65.535;

/// What a Q16.16 coefficient can hold.
const LARGEST_COEFFICIENT: f64 = 32_767.0;

/// Reads and checks a whole file. A complete one has a set-point or a course for every motor.
pub(super) fn read(text: &str, is_complete: bool) -> Checked<Scenario> {
    let file: File = toml::from_str(text).map_err(|error| Fault::of_toml(&error))?;
    let duration_s = within(&file.duration_s, "duration_s", 0.001..=LONGEST_S)?;
    let motors = check_motors(&file, duration_s)?;
    let groups = groups::check(&file.groups, &motors, duration_s)?;
    if is_complete {
        check_commanded(&file, &groups)?;
    }
    check_emulated(&file)?;
    let period = match &file.control_period_ms {
        Some(ms) => Period::from_millis(ranges::whole(ms, "control_period_ms", 1..=100)?).unwrap_or_default(),
        None => Period::DEFAULT,
    };
    let mut expectations = Vec::new();
    for table in &file.expect {
        expectations.extend(table.get_ref().check(table, &motors, &groups, duration_s)?);
    }
    Ok(Scenario {
        name: named(&file.name, "name")?,
        duration_s,
        period,
        seed: ranges::whole_or(&file.seed, "seed", 0..=u32::MAX, 1)?.into(),
        battery: Battery {
            emf: si::Volts(within(&file.battery.emf_v, "emf_v", EMF)?),
            resistance: si::Ohms(within(&file.battery.resistance_ohm, "resistance_ohm", 0.0..=1.0)?),
        },
        bus: file.bus.as_ref().map(|table| table.get_ref().check(duration_s)).transpose()?,
        limits: match &file.bus {
            Some(bus) if file.battery.unlimited => return Err(fault(bus, Mistake::BusUnlimited)),
            Some(bus) => bus.get_ref().limits()?,
            None if file.battery.unlimited => UNLIMITED,
            None => Limits::TWELVE_VOLTS,
        },
        emf_over_time: timeline(
            &file.battery.emf_over_time,
            duration_s,
            |t| &t.at_s,
            |t, _| within(&t.emf_v, "emf_v", EMF),
        )?,
        motors,
        groups,
        wire: None,
        emulated: file.emulated,
        expectations,
    })
}

fn check_motors(file: &File, duration_s: f64) -> Checked<Vec<Motor>> {
    let count = file.motors.get_ref().len();
    if !(1..=MOTORS).contains(&count) {
        return Err(fault(&file.motors, Mistake::Motors(count)));
    }
    let mut motors: Vec<Motor> = Vec::with_capacity(count);
    for table in file.motors.get_ref() {
        let motor = table.get_ref().check(table, duration_s)?;
        if motors.iter().any(|m| m.label == motor.label) {
            return Err(fault(&table.get_ref().label, Mistake::LabelTaken(motor.label)));
        }
        motors.push(motor);
    }
    Ok(motors)
}

/// Every motor has a set-point of its own or a group.
fn check_commanded(file: &File, groups: &[Group]) -> Checked<()> {
    for (index, table) in file.motors.get_ref().iter().enumerate() {
        let grouped = groups.iter().any(|group| group.motors.contains(&index));
        if table.get_ref().setpoints.is_empty() && !grouped {
            return Err(fault(table, Mistake::NoSetpoints));
        }
    }
    Ok(())
}

/// The emulated chip does not report groups, and its bench has neither a bus nor a train.
fn check_emulated(file: &File) -> Checked<()> {
    let mut trains = file.motors.get_ref().iter().filter_map(|motor| motor.get_ref().train.as_ref());
    if let (true, Some(train)) = (file.emulated, trains.next()) {
        return Err(fault(train, Mistake::TrainEmulated));
    }
    match (file.groups.first(), &file.bus) {
        (Some(group), _) if file.emulated => Err(fault(group, Mistake::GroupsEmulated)),
        (_, Some(bus)) if file.emulated => Err(fault(bus, Mistake::BusEmulated)),
        _ => Ok(()),
    }
}

impl MotorTable {
    fn check(&self, whole: &Spanned<Self>, duration_s: f64) -> Checked<Motor> {
        let mut constants = match (&self.motor, &self.constants) {
            (Some(name), None) => {
                characterised(name.get_ref()).map_err(|unknown| fault(name, Mistake::Motor(unknown)))?
            }
            (None, Some(table)) => table.get_ref().check()?,
            _ => return Err(fault(whole, Mistake::MotorOrConstants)),
        };
        if let Some(table) = &self.friction {
            constants.friction = table.check(&constants)?;
        }
        if let Some(table) = &self.cogging {
            constants.cogging = table.check(&constants)?;
        }
        let Some(scheme) = self.scheme.or(self.blend.is_none().then_some(SchemeName::A)) else {
            return Err(fault(whole, Mistake::BlendAlone));
        };
        let blend = self.blend.as_ref().map(|b| *b.get_ref());
        let scheme = scheme.with_blend(blend).map_err(|error| match &self.blend {
            Some(at) => fault(at, Mistake::Blend(error)),
            None => fault(whole, Mistake::Blend(error)),
        })?;
        let any = 0.0..=1000.0;
        let load = Load {
            inertia_after: si::KgM2(optional(&self.load.inertia_kg_m2, "inertia_kg_m2", any.clone())?),
            drag_after: si::Drag(optional(&self.load.drag_nms_per_rad, "drag_nms_per_rad", any)?),
            ..Load::NONE
        };
        let coefficients = &self.coefficients;
        Ok(Motor {
            label: named(&self.label, "label")?,
            constants: match self.inertia {
                Inertia::Rotor => constants.with_measured_rotor_inertia(),
                Inertia::Paper => constants,
            },
            train: self.train.as_ref().map(|train| train.get_ref().check(train, &load)).transpose()?,
            load,
            configuration: self.told.check()?,
            scheme,
            duty: self.duty,
            zero_power: match self.zero_power {
                ZeroPowerWord::Brake => ZeroPower::Brake,
                ZeroPowerWord::Float => ZeroPower::Float,
            },
            on_fault: match self.on_fault {
                OnFaultWord::Coast => OnFault::Coast,
                OnFaultWord::Brake => OnFault::Brake,
            },
            bridge: match self.bridge {
                BridgeWord::Ideal => BRIDGE,
                BridgeWord::Vnh5019 => REAL_BRIDGE,
            },
            current_line: match self.current_line {
                CurrentLineWord::Absent => CurrentLine::Absent,
                CurrentLineWord::Sound => CurrentLine::Sound,
                CurrentLineWord::StuckLow => CurrentLine::StuckLow,
                CurrentLineWord::StuckHigh => CurrentLine::StuckHigh,
            },
            thermal: self.check_thermal(&constants)?,
            current_limit: self.check_current_limit()?,
            acceleration: self.check_acceleration()?,
            velocity: coefficients.velocity.as_ref().map(GainTable::check).transpose()?,
            position: coefficients.position.as_ref().map(GainTable::check).transpose()?,
            setpoints: timeline(&self.setpoints, duration_s, |s| &s.at_s, SetPointTable::check)?,
            torques: self.check_torques(duration_s)?,
            encoder: timeline(&self.encoder, duration_s, |e| &e.at_s, check_encoder)?,
        })
    }

    /// Missing values are the usual ones.
    fn check_thermal(&self, motor: &catalogue::Motor) -> Checked<Option<ThermalLimit>> {
        let Some(table) = &self.thermal else { return Ok(None) };
        let seconds = 1..=u16::MAX;
        let usual = (ThermalLimit::USUAL_WINDING_S, ThermalLimit::USUAL_CASE_S);
        let winding_s = ranges::whole_or(&table.winding_s, "winding_s", seconds.clone(), usual.0)?;
        let case_s = ranges::whole_or(&table.case_s, "case_s", seconds, usual.1)?;
        let continuous_ma = match &table.continuous_a {
            Some(amperes) => (1e3 * within(amperes, "continuous_a", 0.001..=LARGEST_A)?).round() as u16,
            None => thermal_limit(motor).map_or(u16::MAX, |usual| usual.continuous_ma()),
        };
        Ok(ThermalLimit::new(continuous_ma, winding_s, case_s).ok())
    }

    fn check_current_limit(&self) -> Checked<Option<NonZeroU16>> {
        let Some(amperes) = &self.current_limit_a else { return Ok(None) };
        let ma = 1e3 * within(amperes, "current_limit_a", 0.001..=LARGEST_A)?;
        Ok(NonZeroU16::new(ma.round() as u16))
    }

    fn check_acceleration(&self) -> Checked<Option<Acceleration>> {
        let Some(value) = &self.acceleration_cps2 else { return Ok(None) };
        let limit = ranges::whole(value, "acceleration_cps2", 1..=HARDEST_CPS2)?;
        Ok(Acceleration::new(limit).ok())
    }

    /// The load's own torque holds from the start, until the first change.
    fn check_torques(&self, duration_s: f64) -> Checked<Vec<Timed<f64>>> {
        let first = Timed { at_s: 0.0, value: optional(&self.load.torque_nm, "torque_nm", TORQUE)? };
        let changes = timeline(
            &self.torques,
            duration_s,
            |t| &t.at_s,
            |t, _| within(&t.torque_nm, "torque_nm", TORQUE),
        )?;
        Ok(std::iter::once(first).chain(changes).collect())
    }
}

const TORQUE: RangeInclusive<f64> = -1000.0..=1000.0;
const EMF: RangeInclusive<f64> = 1.0..=60.0;

impl ToldChoice {
    fn check(&self) -> Checked<Configuration> {
        match self {
            Self::Nothing => Ok(Configuration { motion: None, ..Configuration::EXACT }),
            Self::Factors(factors) => factors.check(),
        }
    }
}

impl ToldTable {
    fn check(&self) -> Checked<Configuration> {
        let factor = |value: &Option<Spanned<f64>>, key: &'static str| {
            value.as_ref().map_or(Ok(1.0), |value| within(value, key, 0.1..=10.0))
        };
        Ok(Configuration {
            of: None,
            resistance: factor(&self.resistance, "resistance")?,
            emf: factor(&self.emf, "emf")?,
            motion: Some(ConfiguredMotion {
                inertia: factor(&self.inertia, "inertia")?,
                drag: self.drag.as_ref().map_or(Ok(1.0), |drag| within(drag, "drag", 0.0..=10.0))?,
                friction: factor(&self.friction, "friction")?,
            }),
        })
    }
}

impl GainTable {
    fn check(&self) -> Checked<Pidf> {
        let fixed = |value: &Spanned<f64>, key: &'static str| {
            let number = within(value, key, 0.0..=LARGEST_COEFFICIENT)?;
            let bits = (number * f64::from(1 << 16)).round() as i32;
            Ok(Coefficient::from_bits(bits))
        };
        let optional = |value: &Option<Spanned<f64>>, key: &'static str| {
            value.as_ref().map_or(Ok(Coefficient::ZERO), |value| fixed(value, key))
        };
        Ok(Pidf {
            p: fixed(&self.p, "p")?,
            i: optional(&self.i, "i")?,
            d: optional(&self.d, "d")?,
            f: optional(&self.f, "f")?,
        })
    }
}

impl SetPointTable {
    fn check(&self, whole: &Spanned<Self>) -> Checked<Setpoint> {
        let kinds = [
            self.power.is_some(),
            self.current_a.is_some(),
            self.velocity_cps.is_some(),
            self.position_counts.is_some(),
            self.disable.is_some(),
        ];
        if kinds.into_iter().filter(|&given| given).count() != 1 {
            return Err(fault(whole, Mistake::SetpointKind));
        }
        let (tolerance, limit) = (&self.tolerance_counts, &self.speed_limit_cps);
        if let Some(counts) = &self.position_counts {
            let (Some(tolerance), Some(limit)) = (tolerance, limit) else {
                return Err(fault(whole, Mistake::PositionAlone));
            };
            return Ok(Setpoint::Position {
                target: ranges::whole(counts, "position_counts", i32::MIN..=i32::MAX)?,
                tolerance: ranges::whole(tolerance, "tolerance_counts", 0..=u16::MAX)?,
                speed_limit: speed(limit, "speed_limit_cps", 1)?,
            });
        }
        if tolerance.is_some() {
            return Err(fault(whole, Mistake::PositionMissing));
        }
        if let Some(current) = &self.current_a {
            let ma = 1e3 * within(current, "current_a", -LARGEST_A..=LARGEST_A)?;
            let speed_limit = limit.as_ref().map(|limit| speed(limit, "speed_limit_cps", 1)).transpose()?;
            return Ok(Setpoint::Current {
                current: Milliamperes::new(ma.round() as i32),
                // Without a limit the motor may become as fast as it can.
                speed_limit: speed_limit.unwrap_or(CountsPerSecond::new(FASTEST_CPS)),
            });
        }
        if limit.is_some() {
            return Err(fault(whole, Mistake::SpeedLimitAlone));
        }
        if let Some(cps) = &self.velocity_cps {
            return speed(cps, "velocity_cps", -FASTEST_CPS).map(Setpoint::Velocity);
        }
        if let Some(power) = &self.power {
            let counts = within(power, "power", -1.0..=1.0)? * f64::from(Control::MAX.get());
            return Ok(Setpoint::ConstantPower(Control::new(counts.round() as i16)));
        }
        match &self.disable {
            Some(no) if !no.get_ref() => Err(fault(no, Mistake::DisableFalse)),
            _ => Ok(Setpoint::Disabled),
        }
    }
}

fn speed(value: &Spanned<Whole>, key: &'static str, lowest: i32) -> Checked<CountsPerSecond> {
    ranges::whole(value, key, lowest..=FASTEST_CPS).map(CountsPerSecond::new)
}
