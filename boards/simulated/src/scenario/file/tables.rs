//! The tables of a scenario file as they are written, unchecked.

use super::constants::ConstantsTable;
use super::expect::ExpectTable;
use super::friction::{CoggingTable, FrictionTable};
use super::groups::GroupTable;
use super::ranges::Whole;
use super::train::TrainTable;
use crate::scheme::{BlendChoice, DutyWord, SchemeName};
use motor_hub::braking::DutyRule;
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) name: Spanned<String>,
    pub(super) duration_s: Spanned<f64>,
    pub(super) control_period_ms: Option<Spanned<Whole>>,
    pub(super) seed: Option<Spanned<Whole>>,
    #[serde(default)]
    pub(super) emulated: bool,
    pub(super) battery: BatteryTable,
    pub(super) bus: Option<Spanned<BusTable>>,
    pub(super) motors: Spanned<Vec<Spanned<MotorTable>>>,
    #[serde(default)]
    pub(super) groups: Vec<Spanned<GroupTable>>,
    #[serde(default)]
    pub(super) expect: Vec<Spanned<ExpectTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BatteryTable {
    pub(super) emf_v: Spanned<f64>,
    pub(super) resistance_ohm: Spanned<f64>,
    #[serde(default)]
    pub(super) unlimited: bool,
    #[serde(default)]
    pub(super) emf_over_time: Vec<Spanned<EmfTable>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BusTable {
    pub(super) capacitance_f: Spanned<f64>,
    #[serde(default)]
    pub(super) one_way: bool,
    pub(super) opens_at_s: Option<Spanned<f64>>,
    pub(super) burn_between_v: Option<Spanned<[f64; 2]>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EmfTable {
    pub(super) at_s: Spanned<f64>,
    pub(super) emf_v: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MotorTable {
    pub(super) label: Spanned<String>,
    pub(super) motor: Option<Spanned<String>>,
    pub(super) constants: Option<Spanned<ConstantsTable>>,
    #[serde(default)]
    pub(super) inertia: Inertia,
    pub(super) friction: Option<FrictionTable>,
    pub(super) cogging: Option<CoggingTable>,
    #[serde(default)]
    pub(super) load: LoadTable,
    pub(super) train: Option<Spanned<TrainTable>>,
    #[serde(default)]
    pub(super) told: ToldChoice,
    pub(super) scheme: Option<SchemeName>,
    pub(super) blend: Option<Spanned<BlendChoice>>,
    #[serde(default, with = "DutyWord")]
    pub(super) duty: DutyRule,
    #[serde(default)]
    pub(super) zero_power: ZeroPowerWord,
    #[serde(default)]
    pub(super) on_fault: OnFaultWord,
    pub(super) thermal: Option<ThermalTable>,
    pub(super) current_limit_a: Option<Spanned<f64>>,
    #[serde(default)]
    pub(super) bridge: BridgeWord,
    #[serde(default)]
    pub(super) current_line: CurrentLineWord,
    pub(super) acceleration_cps2: Option<Spanned<Whole>>,
    #[serde(default)]
    pub(super) coefficients: CoefficientTables,
    #[serde(default)]
    pub(super) setpoints: Vec<Spanned<SetPointTable>>,
    #[serde(default)]
    pub(super) torques: Vec<Spanned<TorqueTable>>,
    #[serde(default)]
    pub(super) encoder: Vec<Spanned<EncoderTable>>,
}

/// The two rotor inertias that the catalogue knows.
#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Inertia {
    /// As measured on the bare armature.
    #[default]
    Rotor,
    /// As the paper's code uses it: divided by efficiency and squared gear ratio.
    Paper,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum ZeroPowerWord {
    #[default]
    Brake,
    Float,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ThermalTable {
    pub(super) continuous_a: Option<Spanned<f64>>,
    pub(super) winding_s: Option<Spanned<Whole>>,
    pub(super) case_s: Option<Spanned<Whole>>,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum BridgeWord {
    #[default]
    Ideal,
    Vnh5019,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum CurrentLineWord {
    #[default]
    Absent,
    Sound,
    StuckLow,
    StuckHigh,
}

#[derive(Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum OnFaultWord {
    #[default]
    Coast,
    Brake,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LoadTable {
    pub(super) inertia_kg_m2: Option<Spanned<f64>>,
    pub(super) drag_nms_per_rad: Option<Spanned<f64>>,
    pub(super) torque_nm: Option<Spanned<f64>>,
}

/// What a hub may know: factors, or the word "nothing".
pub(super) enum ToldChoice {
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
pub(super) struct ToldTable {
    pub(super) resistance: Option<Spanned<f64>>,
    pub(super) emf: Option<Spanned<f64>>,
    pub(super) inertia: Option<Spanned<f64>>,
    pub(super) drag: Option<Spanned<f64>>,
    pub(super) friction: Option<Spanned<f64>>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CoefficientTables {
    pub(super) velocity: Option<GainTable>,
    pub(super) position: Option<GainTable>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GainTable {
    pub(super) p: Spanned<f64>,
    pub(super) i: Option<Spanned<f64>>,
    pub(super) d: Option<Spanned<f64>>,
    pub(super) f: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SetPointTable {
    pub(super) at_s: Spanned<f64>,
    pub(super) power: Option<Spanned<f64>>,
    pub(super) current_a: Option<Spanned<f64>>,
    pub(super) velocity_cps: Option<Spanned<Whole>>,
    pub(super) position_counts: Option<Spanned<Whole>>,
    pub(super) tolerance_counts: Option<Spanned<Whole>>,
    pub(super) speed_limit_cps: Option<Spanned<Whole>>,
    pub(super) disable: Option<Spanned<bool>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TorqueTable {
    pub(super) at_s: Spanned<f64>,
    pub(super) torque_nm: Spanned<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct EncoderTable {
    pub(super) at_s: Spanned<f64>,
    pub(super) is: Option<EncoderWord>,
    pub(super) glitches_per_s: Option<Spanned<Whole>>,
    pub(super) slot_missing_of: Option<Spanned<Whole>>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum EncoderWord {
    Sound,
    Reversed,
    Unplugged,
    ALow,
    AHigh,
    BLow,
    BHigh,
    ALoose,
    BLoose,
}
