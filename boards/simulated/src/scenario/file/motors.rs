//! The tables `[[motors]]`.

use super::timeline;
use crate::current_line::CurrentLine;
use crate::encoder::{Encoder, Wire};
use crate::hardware::{BRIDGE, REAL_BRIDGE, thermal_limit};
use crate::scenario::error::{At, Checked};
use crate::scenario::numbers::{
    AccelerationLimit, Backlash, CoefficientValue, Counts, CountsPerRev, Current, CurrentLimit, Distance,
    Efficiency, FASTEST_CPS, GearRatio, Glitches, MotorConstant, MotorDrag, Name, OfLoad, Percent, Power,
    RestPositions, RotorInertia, Seconds, Slots, Speed, SpeedLimit, Stiffness, TemperatureRise, Torque,
    WindingConstant, one_of, or, out_of_range,
};
use crate::scenario::types::{Configuration, Motor, Timed};
use crate::scheme::{BlendChoice, SchemeName};
use motor_hub::braking::{DutyRule, Scheme};
use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::{self, characterised};
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::plant::Temperatures;
use motor_hub::model::train::Train;
use motor_hub::model::{load::Load, si};
use motor_hub::motion::Pidf;
use motor_hub::motor::{OnFault, Setpoint, ThermalLimit, ZeroPower};
use motor_hub::units::{Acceleration, Coefficient, Control, CountsPerSecond, Milliamperes};
use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, Error, MapAccess, Unexpected, Visitor};
use std::fmt::{self, Formatter};
use std::num::{NonZeroU16, NonZeroU32};
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MotorTable {
    pub(super) label: Name,
    motor: Option<Spanned<String>>,
    constants: Option<ConstantsTable>,
    #[serde(default)]
    inertia: Inertia,
    friction: Option<FrictionTable>,
    cogging: Option<CoggingTable>,
    #[serde(default)]
    load: LoadTable,
    pub(super) train: Option<Spanned<TrainTable>>,
    #[serde(default, alias = "told", deserialize_with = "factors_or_nothing")]
    configured: Configuration,
    scheme: Option<SchemeName>,
    blend: Option<BlendChoice>,
    #[serde(default)]
    duty: DutyRule,
    #[serde(default)]
    zero_power: ZeroPower,
    #[serde(default)]
    on_fault: OnFault,
    thermal: Option<ThermalTable>,
    current_limit_a: Option<CurrentLimit>,
    #[serde(default, deserialize_with = "bridge")]
    bridge: Option<BridgeConstants>,
    #[serde(default)]
    current_line: CurrentLine,
    acceleration_cps2: Option<AccelerationLimit>,
    #[serde(default)]
    coefficients: CoefficientTables,
    #[serde(default)]
    pub(super) setpoints: Vec<Spanned<SetPointTable>>,
    #[serde(default)]
    torques: Vec<Spanned<TorqueTable>>,
    #[serde(default)]
    heat: Vec<Spanned<HeatTable>>,
    #[serde(default)]
    encoder: Vec<Spanned<EncoderTable>>,
}

/// A motor that the catalogue lacks. All values are of the motor shaft.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ConstantsTable {
    ke_v_s_per_rad: MotorConstant,
    counts_per_rev: CountsPerRev,
    resistance_ohm: WindingConstant,
    inductance_mh: WindingConstant,
    rotor_inertia_kg_m2: RotorInertia,
    gear_ratio: Option<GearRatio>,
    efficiency: Option<Efficiency>,
    kt_nm_per_a: Option<MotorConstant>,
    drag_nms_per_rad: Option<MotorDrag>,
}

/// The two rotor inertias of the catalogue.
#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Inertia {
    /// As measured on the bare armature.
    #[default]
    Rotor,
    /// As the paper's code uses it: divided by efficiency and squared gear ratio.
    Paper,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FrictionTable {
    coulomb_percent: Percent,
    breakaway_percent: Option<Percent>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CoggingTable {
    amplitude_percent: Percent,
    per_turn: RestPositions,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct LoadTable {
    inertia_kg_m2: Option<OfLoad>,
    drag_nms_per_rad: Option<OfLoad>,
    torque_nm: Option<Torque>,
}

/// Backlash and a compliant shaft between a motor and its load.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TrainTable {
    backlash_degrees: Option<Backlash>,
    stiffness_nm_per_rad: Stiffness,
    damping_nms_per_rad: Option<OfLoad>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ThermalTable {
    continuous_a: Option<CurrentLimit>,
    winding_s: Option<Seconds>,
    case_s: Option<Seconds>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
struct CoefficientTables {
    velocity: Option<PidfTable>,
    position: Option<PidfTable>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct PidfTable {
    p: CoefficientValue,
    i: Option<CoefficientValue>,
    d: Option<CoefficientValue>,
    f: Option<CoefficientValue>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetPointTable {
    at_s: f64,
    power: Option<Power>,
    current_a: Option<Current>,
    velocity_cps: Option<Speed>,
    position_counts: Option<Counts>,
    tolerance_counts: Option<Distance>,
    speed_limit_cps: Option<SpeedLimit>,
    disable: Option<bool>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct TorqueTable {
    at_s: f64,
    torque_nm: Torque,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HeatTable {
    at_s: f64,
    winding_k: TemperatureRise,
    magnets_k: TemperatureRise,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EncoderTable {
    at_s: f64,
    #[serde(default, deserialize_with = "encoder")]
    is: Option<Encoder>,
    glitches_per_s: Option<Glitches>,
    slot_missing_of: Option<Slots>,
}

fn bridge<'de, D: Deserializer<'de>>(from: D) -> Result<Option<BridgeConstants>, D::Error> {
    one_of(from, &[("ideal", BRIDGE), ("vnh5019", REAL_BRIDGE)]).map(Some)
}

fn encoder<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Encoder>, D::Error> {
    let stuck = |wire, high| Encoder::Stuck { wire, high };
    let conditions = [
        ("sound", Encoder::Sound),
        ("reversed", Encoder::Reversed),
        ("unplugged", Encoder::Unplugged),
        ("a-low", stuck(Wire::A, false)),
        ("a-high", stuck(Wire::A, true)),
        ("b-low", stuck(Wire::B, false)),
        ("b-high", stuck(Wire::B, true)),
        ("a-loose", Encoder::Loose { wire: Wire::A }),
        ("b-loose", Encoder::Loose { wire: Wire::B }),
    ];
    one_of(from, &conditions).map(Some)
}

impl MotorTable {
    pub(super) fn check(&self, duration_s: f64) -> Checked<Motor> {
        let constants = self.constants()?;
        let load = Load {
            inertia_after: si::KgM2(or(self.load.inertia_kg_m2, 0.0)),
            drag_after: si::Drag(or(self.load.drag_nms_per_rad, 0.0)),
            ..Load::NONE
        };
        let scheme = self.scheme.unwrap_or(SchemeName(Scheme::A)).with_blend(self.blend);
        Ok(Motor {
            label: self.label.0.clone(),
            constants,
            train: self.train.as_ref().map(|table| table.get_ref().check(&load).at(table)).transpose()?,
            load,
            configuration: self.configured,
            scheme: scheme.map_err(|error| error.to_string())?,
            duty: self.duty,
            zero_power: self.zero_power,
            on_fault: self.on_fault,
            bridge: self.bridge.unwrap_or(BRIDGE),
            current_line: self.current_line,
            thermal: self.thermal.as_ref().and_then(|table| table.check(&constants)),
            current_limit: self.current_limit_a.and_then(|limit| NonZeroU16::new(milliamperes(limit))),
            acceleration: self.acceleration_cps2.and_then(|limit| Acceleration::new(limit.0).ok()),
            velocity: self.coefficients.velocity.map(Pidf::from),
            position: self.coefficients.position.map(Pidf::from),
            setpoints: timeline(&self.setpoints, duration_s, |table| (table.at_s, table.check()))?,
            torques: self.torques(duration_s)?,
            heat: timeline(&self.heat, duration_s, |&HeatTable { at_s, winding_k, magnets_k }| {
                (at_s, Ok(Temperatures { winding_k: winding_k.0, magnets_k: magnets_k.0 }))
            })?,
            encoder: timeline(&self.encoder, duration_s, |table| (table.at_s, table.check()))?,
        })
    }

    /// Constants of the motor with friction and cogging, which are shares of its stall torque.
    fn constants(&self) -> Checked<catalogue::Motor> {
        let mut motor = match (&self.motor, &self.constants) {
            (Some(name), None) => {
                characterised(name.get_ref()).map_err(|unknown| unknown.to_string()).at(name)?
            }
            (None, Some(table)) => table.into(),
            _ => return Err("a motor needs either motor = \"NAME\" or constants = { .. }".into()),
        };
        let share =
            |percent: Percent| si::NewtonMetres(percent.0 / 100.0 * motor.stall_torque(si::Volts(12.0)).0);
        let (mut friction, mut cogging) = (motor.friction, motor.cogging);
        if let Some(FrictionTable { coulomb_percent, breakaway_percent }) = self.friction {
            friction = Friction::with_coulomb(share(coulomb_percent));
            if let Some(breakaway) = breakaway_percent {
                if breakaway.0 < coulomb_percent.0 {
                    return Err(
                        out_of_range("breakaway_percent", breakaway.0, coulomb_percent.0..=100.0).into()
                    );
                }
                friction.breakaway = share(breakaway);
            }
        }
        if let Some(CoggingTable { amplitude_percent, per_turn }) = self.cogging {
            cogging = Cogging { amplitude: share(amplitude_percent), per_turn: per_turn.0 };
        }
        (motor.friction, motor.cogging) = (friction, cogging);
        Ok(match self.inertia {
            Inertia::Rotor => motor.with_measured_rotor_inertia(),
            Inertia::Paper => motor,
        })
    }

    /// The load's own torque acts from the start until the first entry of `torques`.
    fn torques(&self, duration_s: f64) -> Checked<Vec<Timed<f64>>> {
        let first = Timed { at_s: 0.0, value: or(self.load.torque_nm, 0.0) };
        let changes = timeline(&self.torques, duration_s, |table| (table.at_s, Ok(table.torque_nm.0)))?;
        Ok(std::iter::once(first).chain(changes).collect())
    }
}

impl TrainTable {
    fn check(&self, load: &Load) -> Result<Train, String> {
        if load.inertia_after.0 == 0.0 {
            return Err("a train needs a load with inertia_kg_m2 above 0, which it turns".to_owned());
        }
        Ok(Train {
            backlash_after: or(self.backlash_degrees, 0.0_f64).to_radians(),
            stiffness_after: self.stiffness_nm_per_rad.0,
            damping_after: or(self.damping_nms_per_rad, 0.0),
        })
    }
}

impl From<&ConstantsTable> for catalogue::Motor {
    fn from(table: &ConstantsTable) -> Self {
        let inertia = si::KgM2(table.rotor_inertia_kg_m2.0);
        Self {
            name: "by its constants",
            r: si::Ohms(table.resistance_ohm.0),
            l: si::Henries(1e-3 * table.inductance_mh.0),
            gear_ratio: or(table.gear_ratio, 1.0),
            eta: or(table.efficiency, 1.0),
            ke: si::EmfConstant(table.ke_v_s_per_rad.0),
            kt: si::TorqueConstant(or(table.kt_nm_per_a, table.ke_v_s_per_rad.0)),
            b: si::Drag(or(table.drag_nms_per_rad, 0.0)),
            friction: Friction::NONE,
            cogging: Cogging::NONE,
            j: inertia,
            j_rotor_measured: inertia,
            counts_per_rev_motor: table.counts_per_rev.0,
        }
    }
}

/// Reads the configuration of a motor in the hub: a table of factors, or the word "nothing".
fn factors_or_nothing<'de, D: Deserializer<'de>>(from: D) -> Result<Configuration, D::Error> {
    struct FactorsOrNothing;
    impl<'de> Visitor<'de> for FactorsOrNothing {
        type Value = Configuration;

        fn expecting(&self, f: &mut Formatter<'_>) -> fmt::Result {
            f.write_str("\"nothing\" or a table of factors")
        }

        fn visit_str<E: Error>(self, word: &str) -> Result<Configuration, E> {
            match word {
                "nothing" => Ok(Configuration { is_motion_known: false, ..Configuration::EXACT }),
                _ => Err(E::invalid_value(Unexpected::Str(word), &self)),
            }
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Configuration, A::Error> {
            Configuration::deserialize(MapAccessDeserializer::new(map))
        }
    }
    from.deserialize_any(FactorsOrNothing)
}

impl ThermalTable {
    /// Returns the thermal limit. Missing keys get their usual values.
    fn check(&self, motor: &catalogue::Motor) -> Option<ThermalLimit> {
        let continuous_ma = match self.continuous_a {
            Some(amperes) => milliamperes(amperes),
            None => thermal_limit(motor).map_or(u16::MAX, |usual| usual.continuous_ma()),
        };
        let winding_s = or(self.winding_s, ThermalLimit::USUAL_WINDING_S);
        ThermalLimit::new(continuous_ma, winding_s, or(self.case_s, ThermalLimit::USUAL_CASE_S)).ok()
    }
}

fn milliamperes(amperes: CurrentLimit) -> u16 {
    (1e3 * amperes.0).round() as u16
}

impl From<PidfTable> for Pidf {
    fn from(table: PidfTable) -> Self {
        let term = |value: Option<CoefficientValue>| {
            Coefficient::from_bits((or(value, 0.0) * f64::from(1 << 16)).round() as i32)
        };
        Self { p: term(Some(table.p)), i: term(table.i), d: term(table.d), f: term(table.f) }
    }
}

impl SetPointTable {
    fn check(&self) -> Result<Setpoint, String> {
        let &Self { power, current_a, velocity_cps, position_counts, disable, .. } = self;
        let (tolerance, limit) = (self.tolerance_counts, self.speed_limit_cps);
        if tolerance.is_some() && position_counts.is_none() {
            return Err("tolerance_counts is allowed with position_counts only".to_owned());
        }
        if limit.is_some() && position_counts.is_none() && current_a.is_none() {
            return Err("speed_limit_cps is allowed with position_counts and current_a only".to_owned());
        }
        let speed_limit = CountsPerSecond::new(or(limit, FASTEST_CPS));
        match (power, current_a, velocity_cps, position_counts, disable) {
            (Some(power), None, None, None, None) => {
                let control = power.0 * f64::from(Control::MAX.get());
                Ok(Setpoint::ConstantPower(Control::new(control.round() as i16)))
            }
            // Without `speed_limit_cps` the limit is a speed that no motor reaches.
            (None, Some(amperes), None, None, None) => {
                let current = Milliamperes::new((1e3 * amperes.0).round() as i32);
                Ok(Setpoint::Current { current, speed_limit })
            }
            (None, None, Some(cps), None, None) => Ok(Setpoint::Velocity(CountsPerSecond::new(cps.0))),
            (None, None, None, Some(target), None) => match (tolerance, limit) {
                (Some(tolerance), Some(_)) => {
                    Ok(Setpoint::Position { target: target.0, tolerance: tolerance.0, speed_limit })
                }
                _ => Err("position_counts needs tolerance_counts and speed_limit_cps".to_owned()),
            },
            (None, None, None, None, Some(true)) => Ok(Setpoint::Disabled),
            (None, None, None, None, Some(false)) => {
                Err("disable = false is not allowed; remove disable".to_owned())
            }
            _ => Err("a set-point needs exactly one of power, current_a, velocity_cps, position_counts and disable"
                .to_owned()),
        }
    }
}

impl EncoderTable {
    fn check(&self) -> Result<Encoder, String> {
        let not_zero = |number| NonZeroU32::new(number).unwrap_or(NonZeroU32::MIN);
        match (self.is, self.glitches_per_s, self.slot_missing_of) {
            (Some(encoder), None, None) => Ok(encoder),
            (None, Some(rate), None) => Ok(Encoder::Glitches { per_second: not_zero(rate.0) }),
            (None, None, Some(slots)) => Ok(Encoder::MissingSlot { of: not_zero(slots.0) }),
            _ => Err("an encoder needs exactly one of is, glitches_per_s and slot_missing_of".to_owned()),
        }
    }
}
