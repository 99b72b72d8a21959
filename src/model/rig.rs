//! A rig: several plants on one battery. A *plant* is a motor with its load and its bridge.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::battery::Battery;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::plant::{PlantInput, Plant};
//! use motor_hub::model::rig::Rig;
//! use motor_hub::model::si::{Hertz, Ohms, Seconds, Volts};
//! use motor_hub::model::switching::Bridge;
//!
//! // The battery voltage drops when two motors start together.
//! let motor = characterised("AM 60 A")?.with_measured_rotor_inertia();
//! let plant = Plant::new(motor, Load::NONE, Bridge::IDEAL, Hertz(20_000.0));
//! let battery = Battery { emf: Volts(12.0), resistance: Ohms(0.1) };
//! let mut rig = Rig::new(battery, vec![plant.clone(), plant]);
//! let flows = rig.run(Seconds(0.01), &[PlantInput::pwm(Mode::Cw98, 1.0); 2]);
//! assert!(flows[0].charge == flows[1].charge && rig.voltage().0 < 12.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::battery::Battery;
use super::bus::{Bus, Shutdown};
use super::plant::{Flow, Plant, PlantInput};
use super::si::{Amps, Coulombs, Seconds, Volts};

/// Longest step with a constant battery voltage, in s, for a rig without bus capacitor: the interval at which a hub
/// samples its encoders and a bus that is not quiet.
const LONGEST_STEP_S: f64 = 1e-3;
/// Longest step with a constant bus voltage, in s. In this time 10 A change the voltage of a capacitor of 1000 uF by
/// 0.5 V.
const LONGEST_BUS_STEP_S: f64 = 50e-6;

/// Plants that share a battery. The battery voltage depends on the current of all plants.
///
/// Without a [`Bus`], the voltage of a step follows from the current of the steps before it. Steps are at most 1 ms.
/// After each step the current is the mean of its last value and the current of the step, as if capacitors smoothed it.
/// The simulation is stable if the resistance of the battery is below about three times the resistance of all windings
/// in parallel.
///
/// With a [`Bus`], the capacitor's energy gives the voltage of a step. The current is not smoothed, and steps are at
/// most 50 us.
#[derive(Clone, Debug)]
pub struct Rig {
    /// Battery that supplies the plants.
    pub battery: Battery,
    /// Plants, in the order of the inputs of [`run`](Self::run).
    pub plants: Vec<Plant>,
    /// Bus with its capacitor between battery and plants; `None` if the plants are directly at the battery.
    pub bus: Option<Bus>,
    /// Current from the battery into the plants, smoothed if there is no bus.
    current: Amps,
    /// Shutdown state of each plant's bridge.
    shutdowns: Vec<Shutdown>,
    /// Lowest and highest voltage so far, V.
    range_volts: (f64, f64),
}

impl Rig {
    /// Creates a rig without bus. No current flows at the start.
    #[must_use]
    pub fn new(battery: Battery, plants: Vec<Plant>) -> Self {
        let shutdowns = vec![Shutdown::None; plants.len()];
        let range_volts = (battery.emf.0, battery.emf.0);
        Self { battery, plants, bus: None, current: Amps(0.0), shutdowns, range_volts }
    }

    /// Adds a bus with its capacitor.
    #[must_use]
    pub fn with_bus(self, bus: Bus) -> Self {
        let range_volts = (bus.voltage().0, bus.voltage().0);
        Self { bus: Some(bus), range_volts, ..self }
    }

    /// Returns the present voltage of the bus, or of the battery if there is no bus.
    #[must_use]
    pub fn voltage(&self) -> Volts {
        self.bus.map_or_else(|| self.battery.voltage(self.current), |bus| bus.voltage())
    }

    /// Returns the lowest and the highest voltage so far, of the start and the ends of all steps.
    #[must_use]
    pub const fn range(&self) -> (Volts, Volts) {
        (Volts(self.range_volts.0), Volts(self.range_volts.1))
    }

    /// Returns the shutdown state of each bridge, in the order of the plants. Without a bus no bridge shuts down.
    #[must_use]
    pub fn shutdowns(&self) -> &[Shutdown] {
        &self.shutdowns
    }

    /// Advances each plant by `dt`, and returns the result of each plant. A plant without an input coasts. A plant
    /// whose bridge has shut down coasts too.
    pub fn run(&mut self, dt: Seconds, inputs: &[PlantInput]) -> Vec<Flow> {
        let mut flows = vec![Flow::default(); self.plants.len()];
        if dt.0 <= 0.0 {
            return flows;
        }
        let longest = if self.bus.is_some() { LONGEST_BUS_STEP_S } else { LONGEST_STEP_S };
        let steps = (dt.0 / longest - 1e-9).ceil().max(1.0);
        let step = Seconds(dt.0 / steps);
        let mut elapsed = 0.0;
        while elapsed < dt.0 - 0.5 * step.0 {
            // The source charges the bus for half a step before and half a step after the plants, as if the plants drew
            // their charge in the middle of the step.
            let half = Seconds(step.0 / 2.0);
            if let Some(bus) = &mut self.bus {
                bus.wait(half, &self.battery);
            }
            let drawn = self.step(step, inputs, &mut flows);
            match &mut self.bus {
                Some(bus) => {
                    bus.draw(Coulombs(drawn));
                    bus.wait(half, &self.battery);
                    self.current = Amps(drawn / step.0);
                }
                None => self.current = Amps(f64::midpoint(self.current.0, drawn / step.0)),
            }
            let volts = self.voltage().0;
            self.range_volts = (self.range_volts.0.min(volts), self.range_volts.1.max(volts));
            elapsed += step.0;
        }
        flows
    }

    /// Advances all plants at the present voltage. Returns the net charge that they drew, C.
    fn step(&mut self, step: Seconds, inputs: &[PlantInput], sums: &mut [Flow]) -> f64 {
        let voltage = self.voltage();
        let mut drawn = 0.0;
        let plants = self.plants.iter_mut().zip(&mut self.shutdowns).zip(sums);
        for (index, ((plant, shutdown), sum)) in plants.enumerate() {
            let mut input = inputs.get(index).copied().unwrap_or(PlantInput::COAST);
            if let Some(bus) = &self.bus {
                *shutdown = shutdown.step(&bus.protection, voltage, (input.on, input.off));
                if *shutdown != Shutdown::None {
                    input = PlantInput { torque_after: input.torque_after, ..PlantInput::COAST };
                }
            }
            let flow = plant.run(step, input, voltage);
            drawn += flow.battery_charge();
            sum.append(&flow);
        }
        drawn
    }
}
