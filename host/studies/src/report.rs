//! Compares the run of a scenario with the same run without a braking regime: tables, JSON, charts and CSV.

mod csv;
pub(crate) mod figures;
mod headline;
pub(crate) mod tables;

use crate::expectations::{Verdict, judge};
use crate::groups::GroupMeasures;
use crate::measures::Measures;
use crate::with_fields;
use serde_json::json;
use simulated::scenario::{Group, Motor, Scenario};
use simulated::scheme::SchemeWords;
use simulated::trace::Trace;

/// Name of the run without a braking regime.
const WITHOUT: &str = "no braking regime";

/// Both runs of a scenario.
pub struct RunReport {
    scenario: Scenario,
    as_set: Trace,
    without: Trace,
    /// Measures by motor: of the run with the schemes of the scenario, and of the run without a braking regime.
    measures: Vec<[Measures; 2]>,
    /// Measures by group, of the same two runs.
    groups: Vec<[GroupMeasures; 2]>,
    /// Verdicts on the run with the schemes of the scenario.
    verdicts: Vec<Verdict>,
}

impl RunReport {
    /// Compares the trace of a scenario with the trace of [`Scenario::without_braking`].
    pub fn new(scenario: Scenario, as_set: Trace, without: Trace) -> Self {
        let measures = scenario.motors.iter().enumerate().map(|(index, motor)| {
            [&as_set, &without].map(|trace| Measures::new(motor, 0.0..scenario.duration_s, trace, index))
        });
        let measures = measures.collect();
        let groups = scenario
            .groups
            .iter()
            .map(|group| [&as_set, &without].map(|trace| GroupMeasures::new(group, &scenario, trace)));
        let groups = groups.collect();
        let verdicts = judge(&scenario, &as_set);
        Self { scenario, as_set, without, measures, groups, verdicts }
    }

    /// The scenario's expectations of the run with its own schemes, and whether they are met.
    pub fn verdicts(&self) -> &[Verdict] {
        &self.verdicts
    }

    /// The results as JSON, for programs.
    pub fn json(&self, files: &[String]) -> serde_json::Value {
        let motors = self.scenario.motors.iter().zip(&self.measures);
        let motor = |(motor, [as_set, without]): (&Motor, &[Measures; 2])| {
            let named = json!({
                "label": motor.label,
                "motor": motor.constants.name,
                "duty": motor.duty,
                "as_set": as_set,
                "without_braking_regime": without,
            });
            with_fields(json!(SchemeWords(motor.scheme)), named)
        };
        let groups = self.scenario.groups.iter().zip(&self.groups);
        let group = |(group, [as_set, without]): (&Group, &[GroupMeasures; 2])| json!({ "label": group.label, "as_set": as_set, "without_braking_regime": without });
        json!({
            "scenario": self.scenario.name,
            "duration_s": self.scenario.duration_s,
            "control_period_ms": self.scenario.period.as_millis(),
            "seed": self.scenario.seed,
            "motors": motors.map(motor).collect::<Vec<_>>(),
            "groups": groups.map(group).collect::<Vec<_>>(),
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
}
