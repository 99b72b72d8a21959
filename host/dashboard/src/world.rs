//! Changes that a page may make to a simulated hub's motors and battery while the hub runs.

use crate::hub::{RequestError, of_motor, within};
use serde::Deserialize;
use serde_json::{Value, json};
use simulated::encoder::{Encoder, Wire};
use simulated::serve::interventions::{Interventions, OnMotor};
use std::ops::RangeInclusive;
use std::sync::{Arc, Mutex, PoisonError};

/// Allowed battery voltages, in volts.
const BATTERY_V: RangeInclusive<f64> = 0.0..=16.0;
/// Allowed torques, in newton metres.
const TORQUE_NM: RangeInclusive<f64> = -5.0..=5.0;
/// Allowed moments of inertia, in kg m².
const INERTIA_KG_M2: RangeInclusive<f64> = 0.0..=0.05;

/// The changes in force, shared by the page's server and the simulation.
#[derive(Clone, Debug, Default)]
pub struct World(Arc<Mutex<Interventions>>);

/// An order that changes the world.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum WorldOrder {
    /// Sets the battery's voltage without load; `None` for the value of the scenario.
    Battery { volts: Option<f64> },
    /// Sets an external torque on a motor's output shaft in newton metres, positive clockwise; `None` for the value of the
    /// scenario.
    Torque { motor: u8, nm: Option<f64> },
    /// Sets the moment of inertia on a motor's output shaft; `None` for the value of the scenario.
    Inertia { motor: u8, kg_m2: Option<f64> },
    /// Blocks a shaft, or lets it turn again.
    Hold { motor: u8, held: bool },
    /// Sets the state of a motor's encoder, by its name in [`ENCODERS`].
    Encoder { motor: u8, is: String },
    /// Drops all changes, so that the values of the scenario are in force again.
    Reset,
}

/// States of an encoder that a page can choose, by name.
const ENCODERS: [(&str, Encoder); 4] = [
    ("sound", Encoder::Sound),
    ("unplugged", Encoder::Unplugged),
    ("reversed", Encoder::Reversed),
    ("loose", Encoder::Loose { wire: Wire::A }),
];

impl World {
    /// The changes in force.
    pub fn interventions(&self) -> Interventions {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// State of the world, as sent to pages.
    pub(crate) fn state(&self) -> Value {
        let Interventions { emf_v, motors, .. } = self.interventions();
        let motor = |OnMotor { torque_nm, inertia_kg_m2, encoder, held }| {
            let encoder =
                ENCODERS.iter().find(|(_, is)| encoder == Some(*is)).map_or("sound", |(name, _)| name);
            json!({ "nm": torque_nm, "kg_m2": inertia_kg_m2, "held": held, "encoder": encoder })
        };
        json!({ "volts": emf_v, "motors": motors.map(motor) })
    }

    /// Restarts the scenario and drops all changes.
    pub(crate) fn restart(&self) {
        let mut now = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        *now = Interventions { restarts: now.restarts.wrapping_add(1), ..Interventions::default() };
    }

    /// Applies an order.
    ///
    /// # Errors
    /// A text with the value that is out of range, and the allowed range.
    pub(crate) fn change(&self, order: &WorldOrder) -> Result<(), RequestError> {
        let mut now = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut wanted = *now;
        match *order {
            WorldOrder::Battery { volts } => {
                wanted.emf_v = within_or_none("a battery", volts, BATTERY_V, "V")?
            }
            WorldOrder::Torque { motor, nm } => {
                of_motor(&mut wanted.motors, motor)?.torque_nm =
                    within_or_none("a torque", nm, TORQUE_NM, "N m")?;
            }
            WorldOrder::Inertia { motor, kg_m2 } => {
                let inertia = within_or_none("a moment of inertia", kg_m2, INERTIA_KG_M2, "kg m²")?;
                of_motor(&mut wanted.motors, motor)?.inertia_kg_m2 = inertia;
            }
            WorldOrder::Hold { motor, held } => of_motor(&mut wanted.motors, motor)?.held = held,
            WorldOrder::Encoder { motor, ref is } => {
                let known = ENCODERS.iter().find(|(name, _)| name == is);
                let (_, encoder) = known.ok_or_else(|| format!("an encoder is not `{is}`"))?;
                of_motor(&mut wanted.motors, motor)?.encoder = Some(*encoder);
            }
            WorldOrder::Reset => {
                wanted = Interventions { restarts: wanted.restarts, ..Interventions::default() }
            }
        }
        *now = wanted;
        Ok(())
    }
}

fn within_or_none(
    what: &str,
    value: Option<f64>,
    allowed: RangeInclusive<f64>,
    unit: &str,
) -> Result<Option<f64>, RequestError> {
    value.map(|value| within(what, value, allowed, unit)).transpose()
}
