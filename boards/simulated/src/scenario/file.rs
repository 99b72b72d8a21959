//! The scenario file as it is written, and the checks that make a [`Scenario`] of it.

mod expect;
mod friction;

use super::{LONGEST_S, Motor, Scenario, Timed, Told, ToldMotion};
use crate::hardware::MOTORS;
use crate::scheme::{BlendChoice, BlendError, DutyWord, SchemeName};
use expect::ExpectTable;
use friction::{CoggingTable, FrictionTable};
use motor_hub::braking::DutyRule;
use motor_hub::model::catalogue::{UnknownMotor, characterised};
use motor_hub::model::{battery::Battery, load::Load, si};
use motor_hub::motion::Pidf;
use motor_hub::motor::{Setpoint, ZeroPower};
use motor_hub::units::{Coefficient, Control, CountsPerSecond, Period};
use serde::Deserialize;
use std::ops::{Range, RangeInclusive};
use toml::Spanned;

/// In counts per second, ten times what any known motor does.
const FASTEST_CPS: i64 = 1_000_000;
/// What a Q16.16 coefficient can hold.
const LARGEST_COEFFICIENT: f64 = 32_767.0;

/// What is wrong with a scenario.
#[derive(Debug, thiserror::Error)]
pub enum Mistake {
    /// Broken TOML, an unknown key or a value of another type, in the parser's words.
    #[error("{0}")]
    Toml(String),
    /// No such motor.
    #[error(transparent)]
    Motor(UnknownMotor),
    /// A blend out of range, or with another scheme than D.
    #[error(transparent)]
    Blend(BlendError),
    /// A blend without `scheme = "D"`.
    #[error("a blend goes with scheme = \"D\" only")]
    BlendAlone,
    /// A number beyond its range.
    #[error("{key} = {value} is out of range; allowed is {low} to {high}")]
    OutOfRange {
        /// What the file calls it.
        key: &'static str,
        /// As it stands there.
        value: f64,
        /// The least that is allowed.
        low: f64,
        /// The most that is allowed.
        high: f64,
    },
    /// More motors than channels, or none.
    #[error("{0} motors; the hub drives 1 to {MOTORS}")]
    Motors(usize),
    /// Two motors of one label.
    #[error("label {0:?} is taken; every motor needs its own")]
    LabelTaken(String),
    /// A motor that is told nothing.
    #[error("no set-points; a motor needs at least one")]
    NoSetpoints,
    /// None, or several, of the four kinds of set-point.
    #[error("a set-point says exactly one of power, velocity_cps, position_counts and disable")]
    SetpointKind,
    /// A position without its two companions.
    #[error("position_counts needs tolerance_counts and speed_limit_cps beside it")]
    PositionAlone,
    /// The companions of a position without one.
    #[error("tolerance_counts and speed_limit_cps go with position_counts only")]
    PositionMissing,
    /// `disable = false`.
    #[error("disable can only be true; leave it out otherwise")]
    DisableFalse,
    /// Something happens before the run, or after it.
    #[error("at_s = {at_s} is outside the run; it lasts from 0 to {duration_s} s")]
    OutsideRun {
        /// When it is to happen.
        at_s: f64,
        /// How long the run is.
        duration_s: f64,
    },
    /// Something happens before what stands above it.
    #[error("at_s = {at_s} is not after {last_s}; times must ascend")]
    NotAfter {
        /// When it is to happen.
        at_s: f64,
        /// When the one before happens.
        last_s: f64,
    },
    /// An empty name, a very long one, or one with control characters.
    #[error("{0} must be 1 to 80 printable characters")]
    Name(&'static str),
    /// An expectation that any run meets.
    #[error("an expectation says at least one thing of a motor or of the battery")]
    ExpectsNothing,
    /// A window that ends before it begins, or there and then.
    #[error("from_s must be less than to_s; without them a window is the whole run")]
    EmptyWindow,
    /// An expectation of a motor that is not there.
    #[error("no motor is labelled {label:?}; there are {}", .known.join(", "))]
    NoSuchLabel {
        /// What the file says.
        label: String,
        /// What could be said.
        known: Vec<String>,
    },
    /// The battery is no motor's own.
    #[error("bus_between_v is of the battery; leave motor out")]
    BusOfMotor,
    /// The lower bound is above the upper one.
    #[error("{0} = [low, high] with low above high")]
    LowAboveHigh(&'static str),
}

/// What is wrong, and where in the text.
#[derive(Debug)]
pub(super) struct Fault {
    span: Range<usize>,
    mistake: Mistake,
}

impl Fault {
    /// With line and column, counted from 1.
    pub(super) fn in_file(self, file: &str, text: &str) -> super::ScenarioError {
        let before = text.get(..self.span.start).unwrap_or(text);
        super::ScenarioError::Wrong {
            file: file.to_owned(),
            line: before.matches('\n').count() + 1,
            column: before.rsplit('\n').next().unwrap_or("").chars().count() + 1,
            mistake: self.mistake,
        }
    }
}

fn fault<T>(at: &Spanned<T>, mistake: Mistake) -> Fault {
    Fault { span: at.span(), mistake }
}

type Checked<T> = Result<T, Fault>;

/// The parser's message as one line.
fn in_words(error: &toml::de::Error) -> Mistake {
    Mistake::Toml(error.message().trim_end().replace('\n', "; "))
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    name: Spanned<String>,
    duration_s: Spanned<f64>,
    control_period_ms: Option<Spanned<i64>>,
    seed: Option<u32>,
    #[serde(default)]
    emulated: bool,
    battery: BatteryTable,
    motors: Spanned<Vec<Spanned<MotorTable>>>,
    #[serde(default)]
    expect: Vec<Spanned<ExpectTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BatteryTable {
    emf_v: Spanned<f64>,
    resistance_ohm: Spanned<f64>,
    #[serde(default)]
    emf_over_time: Vec<Spanned<EmfTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EmfTable {
    at_s: Spanned<f64>,
    emf_v: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MotorTable {
    label: Spanned<String>,
    motor: Spanned<String>,
    #[serde(default)]
    inertia: Inertia,
    friction: Option<FrictionTable>,
    cogging: Option<CoggingTable>,
    #[serde(default)]
    load: LoadTable,
    #[serde(default)]
    told: ToldChoice,
    scheme: Option<SchemeName>,
    blend: Option<Spanned<BlendChoice>>,
    #[serde(default, with = "DutyWord")]
    duty: DutyRule,
    #[serde(default)]
    zero_power: ZeroPowerWord,
    #[serde(default)]
    coefficients: CoefficientTables,
    setpoints: Vec<Spanned<SetPointTable>>,
    #[serde(default)]
    torques: Vec<Spanned<TorqueTable>>,
}

/// The two rotor inertias that the catalogue knows.
#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Inertia {
    /// As measured on the bare armature.
    #[default]
    Rotor,
    /// As the paper's code uses it: divided by efficiency and squared gear ratio.
    Paper,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ZeroPowerWord {
    #[default]
    Brake,
    Float,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct LoadTable {
    inertia_kg_m2: Option<Spanned<f64>>,
    drag_nms_per_rad: Option<Spanned<f64>>,
    torque_nm: Option<Spanned<f64>>,
}

/// What a hub may know: factors, or the word "nothing".
enum ToldChoice {
    Nothing,
    Factors(ToldTable),
}

impl Default for ToldChoice {
    fn default() -> Self {
        Self::Factors(ToldTable::default())
    }
}

impl<'de> Deserialize<'de> for ToldChoice {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> serde::de::Visitor<'de> for Either {
            type Value = ToldChoice;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("\"nothing\" or a table of factors")
            }

            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<ToldChoice, E> {
                if word == "nothing" {
                    Ok(ToldChoice::Nothing)
                } else {
                    Err(E::invalid_value(serde::de::Unexpected::Str(word), &self))
                }
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(self, map: A) -> Result<ToldChoice, A::Error> {
                ToldTable::deserialize(serde::de::value::MapAccessDeserializer::new(map))
                    .map(ToldChoice::Factors)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct ToldTable {
    resistance: Option<Spanned<f64>>,
    emf: Option<Spanned<f64>>,
    inertia: Option<Spanned<f64>>,
    friction: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct CoefficientTables {
    velocity: Option<GainTable>,
    position: Option<GainTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GainTable {
    p: Spanned<f64>,
    i: Option<Spanned<f64>>,
    d: Option<Spanned<f64>>,
    f: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SetPointTable {
    at_s: Spanned<f64>,
    power: Option<Spanned<f64>>,
    velocity_cps: Option<Spanned<i64>>,
    position_counts: Option<i32>,
    tolerance_counts: Option<Spanned<u16>>,
    speed_limit_cps: Option<Spanned<i64>>,
    disable: Option<Spanned<bool>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TorqueTable {
    at_s: Spanned<f64>,
    torque_nm: Spanned<f64>,
}

/// Reads and checks a whole file.
pub(super) fn read(text: &str) -> Checked<Scenario> {
    let file: File = toml::from_str(text)
        .map_err(|error| Fault { span: error.span().unwrap_or(0..0), mistake: in_words(&error) })?;
    let duration_s = within(&file.duration_s, "duration_s", 0.001..=LONGEST_S)?;
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
    let period = match &file.control_period_ms {
        Some(ms) => {
            let checked = within(ms, "control_period_ms", 1..=100)?;
            Period::from_millis(checked as u32).unwrap_or_default()
        }
        None => Period::DEFAULT,
    };
    let mut expectations = Vec::new();
    for table in &file.expect {
        expectations.extend(table.get_ref().check(table, &motors, duration_s)?);
    }
    Ok(Scenario {
        name: named(&file.name, "name")?,
        duration_s,
        period,
        seed: file.seed.unwrap_or(1).into(),
        battery: Battery {
            emf: si::Volts(within(&file.battery.emf_v, "emf_v", EMF)?),
            resistance: si::Ohms(within(&file.battery.resistance_ohm, "resistance_ohm", 0.0..=1.0)?),
        },
        emf_over_time: timeline(
            &file.battery.emf_over_time,
            duration_s,
            |t| &t.at_s,
            |t, _| within(&t.emf_v, "emf_v", EMF),
        )?,
        motors,
        emulated: file.emulated,
        expectations,
    })
}

impl MotorTable {
    fn check(&self, whole: &Spanned<Self>, duration_s: f64) -> Checked<Motor> {
        let mut constants = characterised(self.motor.get_ref())
            .map_err(|unknown| fault(&self.motor, Mistake::Motor(unknown)))?;
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
        if self.setpoints.is_empty() {
            return Err(fault(whole, Mistake::NoSetpoints));
        }
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
            load,
            told: self.told.check()?,
            scheme,
            duty: self.duty,
            zero_power: match self.zero_power {
                ZeroPowerWord::Brake => ZeroPower::Brake,
                ZeroPowerWord::Float => ZeroPower::Float,
            },
            velocity: coefficients.velocity.as_ref().map(GainTable::check).transpose()?,
            position: coefficients.position.as_ref().map(GainTable::check).transpose()?,
            setpoints: timeline(&self.setpoints, duration_s, |s| &s.at_s, SetPointTable::check)?,
            torques: self.check_torques(duration_s)?,
        })
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
    fn check(&self) -> Checked<Told> {
        match self {
            Self::Nothing => Ok(Told { motion: None, ..Told::TRUTH }),
            Self::Factors(factors) => factors.check(),
        }
    }
}

impl ToldTable {
    fn check(&self) -> Checked<Told> {
        let factor = |value: &Option<Spanned<f64>>, key: &'static str| {
            value.as_ref().map_or(Ok(1.0), |value| within(value, key, 0.1..=10.0))
        };
        Ok(Told {
            resistance: factor(&self.resistance, "resistance")?,
            emf: factor(&self.emf, "emf")?,
            motion: Some(ToldMotion {
                inertia: factor(&self.inertia, "inertia")?,
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
            self.velocity_cps.is_some(),
            self.position_counts.is_some(),
            self.disable.is_some(),
        ];
        if kinds.into_iter().filter(|&given| given).count() != 1 {
            return Err(fault(whole, Mistake::SetpointKind));
        }
        let (tolerance, limit) = (&self.tolerance_counts, &self.speed_limit_cps);
        if let Some(counts) = self.position_counts {
            let (Some(tolerance), Some(limit)) = (tolerance, limit) else {
                return Err(fault(whole, Mistake::PositionAlone));
            };
            return Ok(Setpoint::Position {
                target: counts,
                tolerance: *tolerance.get_ref(),
                speed_limit: speed(limit, "speed_limit_cps", 1)?,
            });
        }
        if tolerance.is_some() || limit.is_some() {
            return Err(fault(whole, Mistake::PositionMissing));
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

fn speed(value: &Spanned<i64>, key: &'static str, lowest: i64) -> Checked<CountsPerSecond> {
    within(value, key, lowest..=FASTEST_CPS).map(|cps| CountsPerSecond::new(cps as i32))
}

/// Checks a list of things that happen: each after the one before, within the run.
fn timeline<F, T>(
    entries: &[Spanned<F>],
    duration_s: f64,
    at: impl Fn(&F) -> &Spanned<f64>,
    check: impl Fn(&F, &Spanned<F>) -> Checked<T>,
) -> Checked<Vec<Timed<T>>> {
    let mut timed: Vec<Timed<T>> = Vec::with_capacity(entries.len());
    for entry in entries {
        let time = at(entry.get_ref());
        let at_s = *time.get_ref();
        // Written so that a value that is not a number fails too.
        if !(0.0..=duration_s).contains(&at_s) {
            return Err(fault(time, Mistake::OutsideRun { at_s, duration_s }));
        }
        if let Some(last) = timed.last().filter(|last| last.at_s >= at_s) {
            return Err(fault(time, Mistake::NotAfter { at_s, last_s: last.at_s }));
        }
        timed.push(Timed { at_s, value: check(entry.get_ref(), entry)? });
    }
    Ok(timed)
}

fn named(text: &Spanned<String>, key: &'static str) -> Checked<String> {
    let name = text.get_ref().trim();
    let printable = !name.is_empty() && name.len() <= 80 && !name.chars().any(char::is_control);
    if printable { Ok(name.to_owned()) } else { Err(fault(text, Mistake::Name(key))) }
}

/// Not a number is in no range.
fn within<T>(value: &Spanned<T>, key: &'static str, range: RangeInclusive<T>) -> Checked<T>
where
    T: Copy + PartialOrd + ToFloat,
{
    let number = *value.get_ref();
    if range.contains(&number) {
        return Ok(number);
    }
    let [value_as, low, high] = [number, *range.start(), *range.end()].map(ToFloat::to_float);
    Err(fault(value, Mistake::OutOfRange { key, value: value_as, low, high }))
}

/// A number of the file, for messages.
trait ToFloat {
    fn to_float(self) -> f64;
}

impl ToFloat for f64 {
    fn to_float(self) -> f64 {
        self
    }
}

impl ToFloat for i64 {
    fn to_float(self) -> f64 {
        self as f64
    }
}

/// As [`within`], 0 when absent.
fn optional(value: &Option<Spanned<f64>>, key: &'static str, range: RangeInclusive<f64>) -> Checked<f64> {
    value.as_ref().map_or(Ok(0.0), |value| within(value, key, range))
}
