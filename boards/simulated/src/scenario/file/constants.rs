//! The key `constants`: a motor that the catalogue lacks. All values are of the motor shaft.

use super::ranges::{optional, within};
use crate::scenario::mistake::Checked;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::si::{Drag, EmfConstant, Henries, KgM2, Ohms, TorqueConstant};
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ConstantsTable {
    ke_v_s_per_rad: Spanned<f64>,
    counts_per_rev: Spanned<f64>,
    resistance_ohm: Spanned<f64>,
    inductance_mh: Spanned<f64>,
    rotor_inertia_kg_m2: Spanned<f64>,
    gear_ratio: Option<Spanned<f64>>,
    efficiency: Option<Spanned<f64>>,
    kt_nm_per_a: Option<Spanned<f64>>,
    drag_nms_per_rad: Option<Spanned<f64>>,
}

/// The name of the motor in reports.
const NAME: &str = "by its constants";

impl ConstantsTable {
    pub(super) fn check(&self) -> Checked<Motor> {
        let one = |value: &Option<Spanned<f64>>, key, low, high| {
            value.as_ref().map_or(Ok(1.0), |value| within(value, key, low..=high))
        };
        let ke = within(&self.ke_v_s_per_rad, "ke_v_s_per_rad", 1e-5..=10.0)?;
        let kt = self.kt_nm_per_a.as_ref().map_or(Ok(ke), |kt| within(kt, "kt_nm_per_a", 1e-5..=10.0))?;
        let inertia = KgM2(within(&self.rotor_inertia_kg_m2, "rotor_inertia_kg_m2", 1e-9..=1.0)?);
        Ok(Motor {
            name: NAME,
            r: Ohms(within(&self.resistance_ohm, "resistance_ohm", 0.001..=65.535)?),
            l: Henries(1e-3 * within(&self.inductance_mh, "inductance_mh", 0.001..=65.535)?),
            gear_ratio: one(&self.gear_ratio, "gear_ratio", 0.001, 100_000.0)?,
            eta: one(&self.efficiency, "efficiency", 0.01, 1.0)?,
            ke: EmfConstant(ke),
            kt: TorqueConstant(kt),
            b: Drag(optional(&self.drag_nms_per_rad, "drag_nms_per_rad", 0.0..=1.0)?),
            friction: Friction::NONE,
            cogging: Cogging::NONE,
            j: inertia,
            j_rotor_measured: inertia,
            counts_per_rev_motor: within(&self.counts_per_rev, "counts_per_rev", 1.0..=1e6)?,
        })
    }
}
