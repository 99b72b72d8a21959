//! A scenario's run beside the same run without a braking regime: tables, JSON, charts and CSV.

mod csv;
mod figures;
mod tables;

use crate::NamedFigure;
use crate::expectations::{Verdict, judge};
use crate::measures::Measures;
use motor_hub::braking::DutyRule;
use serde::Serialize;
use serde_json::json;
use simulated::scenario::Scenario;
use simulated::scheme::{self, DutyWord};
use simulated::trace::Trace;
use std::path::PathBuf;

/// What the run without a braking regime is called.
const WITHOUT: &str = "no braking regime";

/// Both runs of a scenario.
pub struct RunReport {
    scenario: Scenario,
    as_set: Trace,
    without: Trace,
    /// By motor: as set, and without a braking regime.
    measures: Vec<[Measures; 2]>,
    /// On the run as set.
    verdicts: Vec<Verdict>,
}

/// One motor in the JSON report.
#[derive(Serialize)]
struct MotorReport<'a> {
    label: &'a str,
    motor: &'a str,
    scheme: String,
    #[serde(with = "DutyWord")]
    duty: DutyRule,
    as_set: &'a Measures,
    without_braking_regime: &'a Measures,
}

impl RunReport {
    /// Compares the trace of a scenario with that of [`Scenario::without_braking`].
    pub fn new(scenario: Scenario, as_set: Trace, without: Trace) -> Self {
        let measures = scenario.motors.iter().enumerate().map(|(index, motor)| {
            [&as_set, &without].map(|trace| Measures::new(motor, scenario.duration_s, trace, index))
        });
        let measures = measures.collect();
        let verdicts = judge(&scenario, &as_set);
        Self { scenario, as_set, without, measures, verdicts }
    }

    /// What was expected of the run as set, and whether it came so.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// The tables for people.
    pub fn tables(&self) -> String {
        tables::all(self)
    }

    /// The document for programs.
    pub fn json(&self, files: &[PathBuf]) -> serde_json::Value {
        let motors = self.scenario.motors.iter().zip(&self.measures);
        let motors: Vec<_> = motors
            .map(|(motor, [as_set, without])| MotorReport {
                label: &motor.label,
                motor: motor.constants.name,
                scheme: scheme::describe(motor.scheme),
                duty: motor.duty,
                as_set,
                without_braking_regime: without,
            })
            .collect();
        json!({
            "scenario": self.scenario.name,
            "duration_s": self.scenario.duration_s,
            "control_period_ms": self.scenario.period.as_millis(),
            "seed": self.scenario.seed,
            "motors": motors,
            "expectations": self.verdicts.iter().map(Verdict::json).collect::<Vec<_>>(),
            "files": files,
        })
    }

    /// The traces as comma-separated values, with the names of their files.
    pub fn traces(&self) -> [(&'static str, String); 2] {
        [
            ("trace.csv", csv::of(&self.scenario, &self.as_set)),
            ("trace-none.csv", csv::of(&self.scenario, &self.without)),
        ]
    }

    /// A chart of each motor, and one of all of them with and without a braking regime.
    pub fn figures(&self) -> Vec<NamedFigure> {
        figures::all(self)
    }
}
