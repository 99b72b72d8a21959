//! The key `train` of a motor: backlash and a compliant shaft between the motor and its load.

use super::ranges::{optional, within};
use crate::scenario::mistake::{Checked, Mistake, fault};
use motor_hub::model::load::Load;
use motor_hub::model::train::Train;
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct TrainTable {
    backlash_degrees: Option<Spanned<f64>>,
    stiffness_nm_per_rad: Spanned<f64>,
    damping_nms_per_rad: Option<Spanned<f64>>,
}

impl TrainTable {
    pub(super) fn check(&self, whole: &Spanned<Self>, load: &Load) -> Checked<Train> {
        if load.inertia_after.0 == 0.0 {
            return Err(fault(whole, Mistake::TrainWithoutLoad));
        }
        Ok(Train {
            backlash_after: optional(&self.backlash_degrees, "backlash_degrees", 0.0..=90.0)?.to_radians(),
            stiffness_after: within(&self.stiffness_nm_per_rad, "stiffness_nm_per_rad", 0.001..=100_000.0)?,
            damping_after: optional(&self.damping_nms_per_rad, "damping_nms_per_rad", 0.0..=1000.0)?,
        })
    }
}
