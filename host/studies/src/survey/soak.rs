//! Hours of random scenarios, run by the hub's own tasks. Every encoder is sound, so every fault is a false alarm. No
//! task may starve the watchdog, and nothing may panic.
//!
//! The motion is configured exactly, with wrong inertias, or not at all (see [`Knowledge`]), in turn from scenario to
//! scenario. Four of eight scenarios have bridges with the timing of real bridges. Dry friction is up to 40 % of the
//! stall torque, four times the dry friction of the survey. A [`sweep`](super::sweep) runs every motor with every
//! setting instead.
//!
//! ```
//! use studies::survey::soak::Soak;
//!
//! let soak = Soak::new(1, 10.0, &mut |_| ())?;
//! assert!(soak.is_clean() && soak.seconds >= 10.0);
//! # Ok::<(), studies::StudyError>(())
//! ```

use super::responses::{Instant, watch};
use super::{Knowledge, circumstances, parallel, random};
use crate::StudyError;
use crate::table::{grouped, paragraph};
use motor_hub::model::friction::Friction;
use motor_hub::model::si::NewtonMetres;
use motor_hub::motor::{Faults, Report};
use serde::Serialize;
use simulated::hardware::REAL_BRIDGE;
use simulated::scenario::Scenario;
use simulated::sim::{self, RunError};
use std::fmt::Write;

/// The results of all scenarios.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Soak {
    /// Seed of the random scenarios; `None` for a sweep.
    pub seed: Option<u64>,
    /// Number of scenarios.
    pub scenarios: u64,
    /// Virtual time of all scenarios, in seconds.
    pub seconds: f64,
    /// Number of motors in all scenarios.
    pub motors: usize,
    /// Number of control ticks of all scenarios.
    pub ticks: usize,
    /// The first fault of each motor for which the hub reported a fault.
    pub alarms: Vec<Alarm>,
    /// Number of motors that were reported as stalled. No motor runs against an end stop, but friction and load
    /// together stop some motors for a while.
    pub stalled: usize,
    /// Numbers of the scenarios in which the watchdog was not fed in time.
    pub starved: Vec<u64>,
}

/// A false alarm.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alarm {
    /// The scenario's number.
    pub scenario: u64,
    /// Number of the motor in the scenario, from 0.
    pub motor: usize,
    /// Seconds from the scenario's start.
    pub at_s: f64,
    /// The reported faults.
    pub what: String,
    /// How the motor was configured.
    #[serde(rename = "told")]
    pub knowledge: Knowledge,
    /// The motor, its load, battery, period, scheme and configuration, in words.
    pub circumstances: String,
}

impl Soak {
    /// Draws and runs scenarios until `seconds` of virtual time are over. `progress` gets the virtual time so far, in
    /// seconds.
    ///
    /// # Errors
    /// If a motor does not fit the firmware.
    pub fn new(seed: u64, seconds: f64, progress: &mut dyn FnMut(f64)) -> Result<Self, StudyError> {
        let mut soak = Self { seed: Some(seed), ..Self::default() };
        while soak.seconds < seconds {
            let number = soak.scenarios;
            let case = scenario(seed, number);
            match sim::run(&case.0, &mut |_| ()) {
                Ok(trace) => {
                    let reports = |motor| trace.motor(motor).map(|(at_s, sample)| (at_s, &sample.report));
                    let motors = (0..case.0.motors.len()).map(|motor| Observed::new(reports(motor)));
                    soak.add(number, &case, trace.ticks.len(), motors.collect());
                }
                Err(RunError::Starved) => {
                    soak.starved.push(number);
                    soak.add(number, &case, 0, Vec::new());
                }
                Err(error) => return Err(error.into()),
            }
            progress(soak.seconds);
        }
        Ok(soak)
    }

    /// True without an alarm and without a starved watchdog.
    pub const fn is_clean(&self) -> bool {
        self.alarms.is_empty() && self.starved.is_empty()
    }

    /// Runs the scenarios of a [`sweep`](super::sweep) without tasks, so the watchdog is not checked. `progress` gets
    /// the number of finished scenarios and the number of all scenarios.
    ///
    /// # Errors
    /// If a motor does not fit the firmware.
    pub fn sweep(cases: &[Case], progress: &mut dyn FnMut(usize, usize)) -> Result<Self, StudyError> {
        let runs = parallel::map(cases, |(scenario, _)| observed(scenario), progress)?;
        let mut soak = Self::default();
        for (number, (motors, case)) in (0..).zip(runs.into_iter().zip(cases)) {
            let (scenario, _) = case;
            let ticks = (1e3 * scenario.duration_s) as usize / scenario.period.as_millis() as usize;
            soak.add(number, case, ticks, motors);
        }
        Ok(soak)
    }

    fn add(&mut self, number: u64, (scenario, knowledge): &Case, ticks: usize, motors: Vec<Observed>) {
        self.scenarios += 1;
        self.seconds += scenario.duration_s;
        self.motors += scenario.motors.len();
        self.ticks += ticks;
        for (motor, Observed { fault, stalled }) in motors.into_iter().enumerate() {
            self.stalled += usize::from(stalled);
            self.alarms.extend(fault.map(|(at_s, faults)| Alarm {
                scenario: number,
                motor,
                at_s,
                what: format!("{faults:?}"),
                knowledge: *knowledge,
                circumstances: format!("{}, {}", circumstances(scenario, motor), knowledge.name),
            }));
        }
    }
}

/// A scenario, and how its motors are configured.
pub type Case = (Scenario, Knowledge);

/// What the hub reported of a motor.
struct Observed {
    /// The first fault with its time in seconds.
    fault: Option<(f64, Faults)>,
    /// True if the motor was ever reported as stalled.
    stalled: bool,
}

impl Observed {
    fn new<'a>(reports: impl Iterator<Item = (f64, &'a Report)>) -> Self {
        let mut observed = Self { fault: None, stalled: false };
        for (at_s, report) in reports {
            observed.stalled |= report.stalled;
            if report.faults.any() {
                observed.fault.get_or_insert((at_s, report.faults));
            }
        }
        observed
    }
}

fn observed(scenario: &Scenario) -> Result<Vec<Observed>, StudyError> {
    let observed = |track: &Vec<Instant>| Observed::new(track.iter().map(|at| (at.point.at_s, &at.report)));
    Ok(watch(scenario)?.iter().map(observed).collect())
}

/// The random scenario of this number, and how its motors are configured.
fn scenario(seed: u64, number: u64) -> Case {
    let mut scenario = random::scenario(seed, number);
    let knowledge = Knowledge::OF_MOTION.get((number % 4) as usize).copied().unwrap_or(Knowledge::EXACT);
    knowledge.configure(&mut scenario.motors);
    for motor in &mut scenario.motors {
        // The friction of the survey is at most 10 % of the stall torque; here it is at most 40 %.
        motor.constants.friction =
            Friction::with_coulomb(NewtonMetres(4.0 * motor.constants.friction.coulomb.0));
        if number % 8 >= 4 {
            motor.bridge = REAL_BRIDGE;
        }
    }
    (scenario, knowledge)
}

/// The result in a sentence: "No false alarm in 12.2 h of 29 376 motors."
pub fn headline(soak: &Soak) -> String {
    let Soak { seconds, motors, alarms, starved, .. } = soak;
    let alarms = match alarms.len() {
        0 => "No false alarm".to_owned(),
        1 => "1 false alarm".to_owned(),
        more => format!("{} false alarms", grouped(more)),
    };
    let time =
        if *seconds < 360.0 { format!("{seconds:.0} s") } else { format!("{:.1} h", seconds / 3600.0) };
    let watchdog = match starved.len() {
        0 => String::new(),
        scenarios => format!("; the watchdog was not fed in time in {} scenarios", grouped(scenarios)),
    };
    let of = if *motors == 1 { "1 motor".to_owned() } else { format!("{} motors", grouped(*motors)) };
    format!("{alarms} in {time} of {of}{watchdog}.")
}

/// The headline, what was run, and every alarm, for people.
pub fn text(soak: &Soak) -> String {
    let Soak { seed, scenarios, seconds, ticks, alarms, stalled, starved, .. } = soak;
    let scenarios = match seed {
        Some(seed) => format!("{scenarios} random scenarios (seed {seed})"),
        None => format!("{scenarios} scenarios"),
    };
    let hours = seconds / 3600.0;
    let ran = format!(
        "{hours:.3} h of virtual time, {scenarios}, {ticks} control ticks; {stalled} motors were \
         reported as stalled for a while."
    );
    let mut out = format!("{}\n\n{}\n", paragraph(&headline(soak)), paragraph(&ran));
    for Alarm { scenario, motor, at_s, what, circumstances, .. } in alarms {
        // Writing to a string does not fail.
        let _ = writeln!(out, "scenario {scenario}, motor {motor}, {at_s:.3} s: {what}; {circumstances}");
    }
    starved
        .iter()
        .for_each(|number| _ = writeln!(out, "scenario {number}: the watchdog was not fed in time"));
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_headline_counts_alarms_hours_and_motors() {
        let clean = Soak { seconds: 43_920.0, motors: 29_376, ..Soak::default() };
        assert_eq!(headline(&clean), "No false alarm in 12.2 h of 29 376 motors.");
        let one = Soak { seconds: 8.0, motors: 1, ..Soak::default() };
        assert_eq!(headline(&one), "No false alarm in 8 s of 1 motor.");
        let starved = Soak { seconds: 10.0, motors: 3, starved: vec![1, 2], ..Soak::default() };
        assert_eq!(
            headline(&starved),
            "No false alarm in 10 s of 3 motors; the watchdog was not fed in time in 2 scenarios."
        );
    }
}
