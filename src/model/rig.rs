//! Several plants on one battery.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::battery::Battery;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::plant::{Influence, Plant};
//! use motor_hub::model::rig::Rig;
//! use motor_hub::model::si::{Hertz, Ohms, Seconds, Volts};
//! use motor_hub::model::switching::Bridge;
//!
//! // Two motors that start together pull the battery's voltage down.
//! let motor = characterised("AM 60 A")?.with_measured_rotor_inertia();
//! let plant = Plant::new(motor, Load::NONE, Bridge::IDEAL, Hertz(20_000.0));
//! let battery = Battery { emf: Volts(12.0), resistance: Ohms(0.1) };
//! let mut rig = Rig::new(battery, vec![plant.clone(), plant]);
//! let flow = rig.run(Seconds(0.01), &[Influence::pwm(Mode::Cw98, 1.0); 2]);
//! assert!(flow.current.0 > 1.0 && rig.voltage().0 < 12.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::battery::Battery;
use super::plant::{Flow, Influence, Plant};
use super::si::{Amps, Seconds, Volts};

/// Longest time for which the battery's voltage is held constant, s.
const LONGEST_STEP: f64 = 1e-3;

/// Plants that share a battery, whose voltage sags with what all of them draw.
///
/// The voltage of a step follows from the current of the steps before it, smoothed over about two
/// steps of at most 1 ms (a supply's capacitors do the same). That stays stable as long as the
/// battery's resistance is below about three times that of all windings in parallel.
#[derive(Clone, Debug)]
pub struct Rig {
    /// The battery.
    pub battery: Battery,
    /// The plants, in the order of the influences.
    pub plants: Vec<Plant>,
    current: Amps,
}

/// What a run of the whole rig did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RigFlow {
    /// Battery voltage at the end of the run.
    pub voltage: Volts,
    /// Mean net current out of the battery.
    pub current: Amps,
    /// One per plant.
    pub flows: Vec<Flow>,
}

impl Rig {
    /// A rig at rest.
    #[must_use]
    pub const fn new(battery: Battery, plants: Vec<Plant>) -> Self {
        Self { battery, plants, current: Amps(0.0) }
    }

    /// Present voltage of the battery.
    #[must_use]
    pub fn voltage(&self) -> Volts {
        self.battery.voltage(self.current)
    }

    /// Advances every plant by `dt`. One without an influence coasts.
    pub fn run(&mut self, dt: Seconds, influences: &[Influence]) -> RigFlow {
        let mut total = RigFlow { flows: vec![Flow::default(); self.plants.len()], ..RigFlow::default() };
        if dt.0 <= 0.0 {
            total.voltage = self.voltage();
            return total;
        }
        let steps = (dt.0 / LONGEST_STEP - 1e-9).ceil().max(1.0);
        let step = Seconds(dt.0 / steps);
        let mut elapsed = 0.0;
        while elapsed < dt.0 - 0.5 * step.0 {
            let voltage = self.voltage();
            let mut drawn = 0.0;
            for (index, (plant, sum)) in self.plants.iter_mut().zip(&mut total.flows).enumerate() {
                let influence = influences.get(index).copied().unwrap_or(Influence::COAST);
                let flow = plant.run(step, influence, voltage);
                drawn += flow.battery_charge();
                sum.append(&flow);
            }
            self.current = Amps(f64::midpoint(self.current.0, drawn / step.0));
            elapsed += step.0;
        }
        let charge: f64 = total.flows.iter().map(Flow::battery_charge).sum();
        total.current = Amps(charge / dt.0);
        total.voltage = self.voltage();
        total
    }
}
