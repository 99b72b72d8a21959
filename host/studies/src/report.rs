//! A scenario's run beside the same run without a braking regime: tables, JSON, charts and CSV.
//!
//! ```
//! use simulated::{scenario::Scenario, sim};
//! use studies::report::RunReport;
//!
//! let scenario = Scenario { duration_s: 0.5, ..Scenario::default_one()? };
//! let as_set = sim::run(&scenario, &mut |_| ())?;
//! let without = sim::run(&scenario.without_braking(), &mut |_| ())?;
//! let report = RunReport::new(scenario, as_set, without);
//! assert!(report.tables().contains("no braking regime"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod csv;
mod figures;
mod headline;
mod runs;
mod tables;

use crate::NamedFigure;
use crate::expectations::Verdict;
use crate::measures::Measures;
use crate::table;
use motor_hub::braking::DutyRule;
use serde::Serialize;
use serde_json::json;
use simulated::scheme::{DutyWord, SchemeWords};
use std::path::PathBuf;

pub use runs::RunReport;

/// One motor in the JSON report.
#[derive(Serialize)]
struct MotorReport<'a> {
    label: &'a str,
    motor: &'a str,
    #[serde(flatten)]
    scheme: SchemeWords,
    #[serde(with = "DutyWord")]
    duty: DutyRule,
    as_set: &'a Measures,
    without_braking_regime: &'a Measures,
}

impl RunReport {
    /// The scenario's expectations of the run as set, and whether they are met.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// The result in a sentence: the response whose settling time differs most with and without braking.
    pub fn headline(&self) -> String {
        headline::headline(self)
    }

    /// The headline and the tables.
    pub fn tables(&self) -> String {
        format!("{}\n\n{}", table::paragraph(&self.headline()), tables::all(self))
    }

    /// The document for programs.
    pub fn json(&self, files: &[PathBuf]) -> serde_json::Value {
        let motors = self.scenario.motors.iter().zip(&self.measures);
        let motors: Vec<_> = motors
            .map(|(motor, [as_set, without])| MotorReport {
                label: &motor.label,
                motor: motor.constants.name,
                scheme: SchemeWords(motor.scheme),
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

    /// A chart of each motor, and one of all motors with and without a braking regime.
    pub fn figures(&self) -> Vec<NamedFigure> {
        figures::all(self)
    }
}
