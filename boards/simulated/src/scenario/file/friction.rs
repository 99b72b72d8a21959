//! The keys `friction` and `cogging` of a motor, in percent of its stall torque at 12 V.

use super::ranges::{Whole, whole, within};
use crate::scenario::mistake::Checked;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::friction::{Cogging, Friction};
use motor_hub::model::si::{NewtonMetres, Volts};
use serde::Deserialize;
use toml::Spanned;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FrictionTable {
    coulomb_percent: Spanned<f64>,
    breakaway_percent: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CoggingTable {
    amplitude_percent: Spanned<f64>,
    per_turn: Spanned<Whole>,
}

fn share(motor: &Motor, percent: f64) -> NewtonMetres {
    NewtonMetres(percent / 100.0 * motor.stall_torque(Volts(12.0)).0)
}

impl FrictionTable {
    pub(super) fn check(&self, motor: &Motor) -> Checked<Friction> {
        let coulomb = within(&self.coulomb_percent, "coulomb_percent", 0.0..=100.0)?;
        let sliding = Friction::with_coulomb(share(motor, coulomb));
        let Some(breakaway) = &self.breakaway_percent else {
            return Ok(sliding);
        };
        let breakaway = within(breakaway, "breakaway_percent", coulomb..=100.0)?;
        Ok(Friction { breakaway: share(motor, breakaway), ..sliding })
    }
}

impl CoggingTable {
    pub(super) fn check(&self, motor: &Motor) -> Checked<Cogging> {
        let amplitude = within(&self.amplitude_percent, "amplitude_percent", 0.0..=100.0)?;
        let per_turn = whole(&self.per_turn, "per_turn", 1..=1000)?;
        Ok(Cogging { amplitude: share(motor, amplitude), per_turn })
    }
}
