//! Interventions in the battery and the motors of a served hub. An intervention replaces a value of the scenario.
//!
//! ```
//! use simulated::serve::interventions::{Interventions, OnMotor};
//!
//! // The shaft of motor 1 is held, and the battery is nearly empty.
//! let mut now = Interventions { emf_v: Some(9.5), ..Interventions::default() };
//! now.motors[1] = OnMotor { held: true, ..OnMotor::default() };
//! ```

use crate::encoder::Encoder;
use crate::hardware::MOTORS;
use crate::scenario::{Scenario, Timed};
use crate::world::Board;
use motor_hub::model::friction::Friction;
use motor_hub::model::load::Load;
use motor_hub::model::si::{KgM2, NewtonMetres, Volts};

/// Friction of a shaft that is held, as a multiple of the motor's stall torque at [`NOMINAL_V`].
const HELD: f64 = 20.0;
/// Voltage at which the stall torque for [`HELD`] is computed, in volts.
const NOMINAL_V: f64 = 12.0;

/// Interventions in battery and motors; `None` leaves a value to the scenario.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Interventions {
    /// Voltage of the battery without load, in volts.
    pub emf_v: Option<f64>,
    /// Interventions of each motor.
    pub motors: [OnMotor; MOTORS],
    /// A change of this number restarts the scenario's time: torques, battery with its contactor, encoders and
    /// connected devices begin again.
    pub restarts: u32,
}

/// Interventions in one motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OnMotor {
    /// External torque on the output shaft in newton metres, positive clockwise.
    pub torque_nm: Option<f64>,
    /// Moment of inertia on the output shaft, in kg m².
    pub inertia_kg_m2: Option<f64>,
    /// State of the encoder.
    pub encoder: Option<Encoder>,
    /// True if the shaft is held and cannot turn.
    pub held: bool,
}

impl Interventions {
    /// Returns the scenario with the battery voltage, the torques and the encoders of these interventions.
    pub(super) fn replace_in(&self, scenario: &Scenario) -> Scenario {
        let mut replaced = scenario.clone();
        if let Some(volts) = self.emf_v {
            replaced.battery.emf = Volts(volts);
            replaced.emf_over_time.clear();
        }
        for (motor, wanted) in replaced.motors.iter_mut().zip(&self.motors) {
            if let Some(value) = wanted.torque_nm {
                motor.torques = vec![Timed { at_s: 0.0, value }];
            }
            if let Some(value) = wanted.encoder {
                motor.encoder = vec![Timed { at_s: 0.0, value }];
            }
        }
        replaced
    }

    /// Changes inertias and friction of the shafts where they differ from the interventions `before`.
    pub(super) fn set_loads(&self, before: &Self, scenario: &Scenario, board: &Board) {
        let pairs = self.motors.iter().zip(&before.motors).enumerate();
        for ((index, (wanted, before)), motor) in pairs.zip(&scenario.motors) {
            if wanted.inertia_kg_m2 != before.inertia_kg_m2 {
                let inertia_after = wanted.inertia_kg_m2.map_or(motor.load.inertia_after, KgM2);
                board.with_plant(index, |plant| plant.set_load(Load { inertia_after, ..motor.load }));
            }
            if wanted.held != before.held {
                let stall = motor.constants.stall_torque(Volts(NOMINAL_V));
                let held = Friction::with_coulomb(NewtonMetres(HELD * stall.0));
                let friction = if wanted.held { held } else { motor.constants.friction };
                board.with_plant(index, |plant| plant.set_friction(friction));
            }
        }
    }
}
