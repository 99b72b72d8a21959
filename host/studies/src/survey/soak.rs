//! Hours of drawn scenarios, run by the hub's own tasks: every encoder is sound, so none may be doubted; no task may
//! keep the watchdog waiting; nothing may panic.
//!
//! Scenario by scenario the hub is told everything, wrong inertias, or nothing (see [`Knowledge`]), and every other
//! four have bridges with the timing of real ones. Dry friction is up to 40 % of the stall torque, four times the survey's.
//!
//! ```
//! use studies::survey::soak::Soak;
//!
//! let soak = Soak::new(1, 10.0, &mut |_| ())?;
//! assert!(soak.is_clean() && soak.seconds >= 10.0);
//! # Ok::<(), studies::StudyError>(())
//! ```

use super::{Knowledge, circumstances, random};
use crate::StudyError;
use motor_hub::model::friction::Friction;
use motor_hub::model::si::NewtonMetres;
use motor_hub::motor::Faults;
use serde::Serialize;
use simulated::hardware::REAL_BRIDGE;
use simulated::scenario::Scenario;
use simulated::sim::{self, RunError};
use std::fmt::Write;

/// What became of the scenarios.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Soak {
    /// What they follow from.
    pub seed: u64,
    /// How many there were.
    pub scenarios: u64,
    /// Virtual time of all of them.
    pub seconds: f64,
    /// Motors in all of them.
    pub motors: usize,
    /// Control ticks of all of them.
    pub ticks: usize,
    /// Faults that were reported of sound motors, the first of each motor.
    pub alarms: Vec<Alarm>,
    /// Scenarios in which the watchdog was not fed in time.
    pub starved: Vec<u64>,
}

/// A fault that was none.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alarm {
    /// The scenario's number.
    pub scenario: u64,
    /// The motor's number in it, from 0.
    pub motor: usize,
    /// Seconds from the scenario's start.
    pub at_s: f64,
    /// What was reported.
    pub what: String,
    /// What the hub knew of the motor.
    pub told: Knowledge,
    /// The motor, its load, battery, period, scheme, and what the hub was told, in words.
    pub circumstances: String,
}

impl Soak {
    /// Draws and runs scenarios until `seconds` of virtual time are over; `progress` is told how many are.
    ///
    /// # Errors
    /// If a motor does not fit the firmware.
    pub fn new(seed: u64, seconds: f64, progress: &mut dyn FnMut(f64)) -> Result<Self, StudyError> {
        let mut soak = Self { seed, ..Self::default() };
        while soak.seconds < seconds {
            soak.add(soak.scenarios)?;
            progress(soak.seconds);
        }
        Ok(soak)
    }

    /// True if nothing happened that should not.
    pub const fn is_clean(&self) -> bool {
        self.alarms.is_empty() && self.starved.is_empty()
    }

    /// Runs one more.
    fn add(&mut self, number: u64) -> Result<(), StudyError> {
        let (scenario, knowledge) = scenario(self.seed, number);
        self.scenarios += 1;
        self.seconds += scenario.duration_s;
        self.motors += scenario.motors.len();
        let trace = match sim::run(&scenario, &mut |_| ()) {
            Err(RunError::Starved) => {
                self.starved.push(number);
                return Ok(());
            }
            trace => trace?,
        };
        self.ticks += trace.ticks.len();
        for motor in 0..scenario.motors.len() {
            let samples = trace.ticks.iter().filter_map(|tick| Some((tick.at_s, tick.motors.get(motor)?)));
            // The battery is measured before the first tick.
            let mut faults = samples.map(|(at_s, sample)| (at_s, sample.report.faults));
            if let Some((at_s, faults)) = faults.find(|(_, faults)| faults.any()) {
                let circumstances = format!("{}, {}", circumstances(&scenario, motor), knowledge.name());
                self.alarms.push(Alarm {
                    scenario: number,
                    motor,
                    at_s,
                    what: words(faults),
                    told: knowledge,
                    circumstances,
                });
            }
        }
        Ok(())
    }
}

/// The scenario of this number, and what the hub knows there.
fn scenario(seed: u64, number: u64) -> (Scenario, Knowledge) {
    let mut scenario = random::scenario(seed, number);
    let knowledge = Knowledge::ALL.into_iter().cycle().nth((number % 4) as usize).unwrap_or(Knowledge::Exact);
    for motor in &mut scenario.motors {
        motor.told = knowledge.told();
        // From at most 10 % of the stall torque to at most 40.
        motor.constants.friction =
            Friction::with_coulomb(NewtonMetres(4.0 * motor.constants.friction.coulomb.0));
        if number % 8 >= 4 {
            motor.bridge = REAL_BRIDGE;
        }
    }
    (scenario, knowledge)
}

fn words(faults: Faults) -> String {
    format!("{faults:?}")
}

/// What happened, for people.
pub fn text(soak: &Soak) -> String {
    let Soak { seed, scenarios, seconds, motors, ticks, alarms, starved } = soak;
    let mut out = format!(
        "{:.3} h of virtual time: {scenarios} scenarios by lot (seed {seed}), {motors} motors, {ticks} control ticks\n\
         {} false alarms, the watchdog starved in {} scenarios\n",
        seconds / 3600.0,
        alarms.len(),
        starved.len()
    );
    for Alarm { scenario, motor, at_s, what, circumstances, .. } in alarms {
        // Writing to a string does not fail.
        let _ = writeln!(out, "scenario {scenario}, motor {motor}, {at_s:.3} s: {what}; {circumstances}");
    }
    starved.iter().for_each(|number| _ = writeln!(out, "scenario {number}: the watchdog starved"));
    out
}
