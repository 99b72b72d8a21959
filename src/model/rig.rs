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
use super::bus::{Bus, Shutdown};
use super::plant::{Flow, Influence, Plant};
use super::si::{Amps, Coulombs, Seconds, Volts};

/// Longest time for which the battery's voltage is held constant, s.
const LONGEST_STEP: f64 = 1e-3;
/// The same of a bus with a capacitor, which a few amperes move by volts in a millisecond.
const LONGEST_BUS_STEP: f64 = 50e-6;

/// Plants that share a battery, whose voltage sags with what all of them draw.
///
/// The voltage of a step follows from the current of the steps before it, smoothed over about two
/// steps of at most 1 ms (a supply's capacitors do the same). That stays stable as long as the
/// battery's resistance is below about three times that of all windings in parallel.
///
/// With a [`Bus`] its capacitor has the voltage, by the energy that it is given and that is taken from it: nothing is
/// smoothed, and steps are of 50 us.
#[derive(Clone, Debug)]
pub struct Rig {
    /// The battery.
    pub battery: Battery,
    /// The plants, in the order of the influences.
    pub plants: Vec<Plant>,
    /// The capacitor behind the battery, if there is one.
    pub bus: Option<Bus>,
    current: Amps,
    shutdowns: Vec<Shutdown>,
    range: (f64, f64),
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
    pub fn new(battery: Battery, plants: Vec<Plant>) -> Self {
        let shutdowns = vec![Shutdown::None; plants.len()];
        let range = (battery.emf.0, battery.emf.0);
        Self { battery, plants, bus: None, current: Amps(0.0), shutdowns, range }
    }

    /// The same with a capacitor.
    #[must_use]
    pub fn with_bus(self, bus: Bus) -> Self {
        let range = (bus.voltage().0, bus.voltage().0);
        Self { bus: Some(bus), range, ..self }
    }

    /// Present voltage of the battery, or of the bus.
    #[must_use]
    pub fn voltage(&self) -> Volts {
        self.bus.map_or_else(|| self.battery.voltage(self.current), |bus| bus.voltage())
    }

    /// The lowest and the highest voltage so far, step by step.
    #[must_use]
    pub const fn range(&self) -> (Volts, Volts) {
        (Volts(self.range.0), Volts(self.range.1))
    }

    /// Bridges that have opened by themselves, in the order of the plants.
    #[must_use]
    pub fn shutdowns(&self) -> &[Shutdown] {
        &self.shutdowns
    }

    /// Advances every plant by `dt`. One without an influence coasts.
    pub fn run(&mut self, dt: Seconds, influences: &[Influence]) -> RigFlow {
        let mut total = RigFlow { flows: vec![Flow::default(); self.plants.len()], ..RigFlow::default() };
        if dt.0 <= 0.0 {
            total.voltage = self.voltage();
            return total;
        }
        let longest = if self.bus.is_some() { LONGEST_BUS_STEP } else { LONGEST_STEP };
        let steps = (dt.0 / longest - 1e-9).ceil().max(1.0);
        let step = Seconds(dt.0 / steps);
        let mut elapsed = 0.0;
        while elapsed < dt.0 - 0.5 * step.0 {
            // Half before and half after: what the source gives meanwhile counts as in the middle.
            let half = Seconds(step.0 / 2.0);
            if let Some(bus) = &mut self.bus {
                bus.wait(half, &self.battery);
            }
            let drawn = self.step(step, influences, &mut total.flows);
            match &mut self.bus {
                Some(bus) => {
                    bus.draw(Coulombs(drawn));
                    bus.wait(half, &self.battery);
                    self.current = Amps(drawn / step.0);
                }
                None => self.current = Amps(f64::midpoint(self.current.0, drawn / step.0)),
            }
            let now = self.voltage().0;
            self.range = (self.range.0.min(now), self.range.1.max(now));
            elapsed += step.0;
        }
        let charge: f64 = total.flows.iter().map(Flow::battery_charge).sum();
        total.current = Amps(charge / dt.0);
        total.voltage = self.voltage();
        total
    }

    /// All plants at the present voltage; the charge that they drew.
    fn step(&mut self, step: Seconds, influences: &[Influence], sums: &mut [Flow]) -> f64 {
        let voltage = self.voltage();
        let mut drawn = 0.0;
        let plants = self.plants.iter_mut().zip(&mut self.shutdowns).zip(sums);
        for (index, ((plant, shutdown), sum)) in plants.enumerate() {
            let mut influence = influences.get(index).copied().unwrap_or(Influence::COAST);
            if let Some(bus) = &self.bus {
                *shutdown = shutdown.step(&bus.protection, voltage, (influence.on, influence.off));
                if *shutdown != Shutdown::None {
                    influence = Influence { torque_after: influence.torque_after, ..Influence::COAST };
                }
            }
            let flow = plant.run(step, influence, voltage);
            drawn += flow.battery_charge();
            sum.append(&flow);
        }
        drawn
    }
}
