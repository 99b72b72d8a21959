//! What somebody does to the world of a hub while it is served, in the place of what its scenario has for it.
//!
//! ```
//! use simulated::serve::hands::{Hands, OnMotor};
//!
//! // Somebody holds the shaft of motor 1, and the battery is nearly empty.
//! let mut hands = Hands { emf_v: Some(9.5), ..Hands::default() };
//! hands.motors[1] = OnMotor { held: true, ..OnMotor::default() };
//! ```

use crate::encoder::Encoder;
use crate::hardware::MOTORS;
use crate::scenario::Scenario;
use crate::world::Board;
use motor_hub::model::friction::Friction;
use motor_hub::model::load::Load;
use motor_hub::model::si::{KgM2, NewtonMetres, Volts};

/// Of a shaft that is held, in stall torques of its motor at [`NOMINAL_V`].
const HELD: f64 = 20.0;
const NOMINAL_V: f64 = 12.0;

/// What somebody does to battery and motors; `None` leaves it to the scenario.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hands {
    /// The battery's voltage without load, in volts.
    pub emf_v: Option<f64>,
    /// By motor.
    pub motors: [OnMotor; MOTORS],
    /// Whenever this changes, the scenario's time begins anew: its torques, its battery, its encoders.
    pub restarts: u32,
}

/// What somebody does to one motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OnMotor {
    /// External torque on the output shaft in newton metres, positive clockwise.
    pub torque_nm: Option<f64>,
    /// Moment of inertia that the output shaft turns, in kg m².
    pub inertia_kg_m2: Option<f64>,
    /// How its encoder is.
    pub encoder: Option<Encoder>,
    /// The shaft cannot turn.
    pub held: bool,
}

impl Hands {
    /// External torques on the output shafts in newton metres, of a scenario at a time in seconds.
    pub(super) fn torques(&self, scenario: &Scenario, at_s: f64) -> Vec<f64> {
        let motors = scenario.motors.iter().zip(&self.motors);
        motors.map(|(motor, hand)| hand.torque_nm.unwrap_or_else(|| motor.torque_at(at_s))).collect()
    }

    /// What the scenario does to battery and encoders at each step is replaced.
    pub(super) fn meddle(&self, board: &Board) {
        if let Some(volts) = self.emf_v {
            board.set_emf(Volts(volts));
        }
        for (index, hand) in self.motors.iter().enumerate() {
            if let Some(encoder) = hand.encoder {
                board.set_encoder(index, encoder);
            }
        }
    }

    /// Shafts are loaded and held as they are from now on, where that is otherwise than `before`.
    pub(super) fn grip(&self, before: &Self, scenario: &Scenario, board: &Board) {
        let hands = self.motors.iter().zip(&before.motors).enumerate();
        for ((index, (hand, before)), motor) in hands.zip(&scenario.motors) {
            if hand.inertia_kg_m2 != before.inertia_kg_m2 {
                let inertia_after = hand.inertia_kg_m2.map_or(motor.load.inertia_after, KgM2);
                board.set_load(index, Load { inertia_after, ..motor.load });
            }
            if hand.held != before.held {
                let stall = motor.constants.stall_torque(Volts(NOMINAL_V));
                let held = Friction::with_coulomb(NewtonMetres(HELD * stall.0));
                board.set_friction(index, if hand.held { held } else { motor.constants.friction });
            }
        }
    }
}
