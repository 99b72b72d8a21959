//! The two runs of a report, and their measures.

use crate::expectations::{Verdict, judge};
use crate::measures::Measures;
use simulated::scenario::Scenario;
use simulated::trace::Trace;

/// Name of the run without a braking regime.
pub(super) const WITHOUT: &str = "no braking regime";

/// Both runs of a scenario.
pub struct RunReport {
    pub(super) scenario: Scenario,
    pub(super) as_set: Trace,
    pub(super) without: Trace,
    /// Measures by motor: of the run as set, and of the run without a braking regime.
    pub(super) measures: Vec<[Measures; 2]>,
    /// Verdicts on the run as set.
    pub(super) verdicts: Vec<Verdict>,
}

impl RunReport {
    /// Compares the trace of a scenario with the trace of [`Scenario::without_braking`].
    pub fn new(scenario: Scenario, as_set: Trace, without: Trace) -> Self {
        let measures = scenario.motors.iter().enumerate().map(|(index, motor)| {
            [&as_set, &without].map(|trace| Measures::new(motor, scenario.duration_s, trace, index))
        });
        let measures = measures.collect();
        let verdicts = judge(&scenario, &as_set);
        Self { scenario, as_set, without, measures, verdicts }
    }
}
