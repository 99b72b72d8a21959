//! One run of the comparison, and its measures.

use super::tasks::Task;
use super::tuning::Gains;
use super::variant::Variant;
use crate::measures::{Measures, Response};
use crate::{StudyError, table, with_fields};
use serde::{Serialize, Serializer};
use serde_json::json;
use simulated::scheme::SchemeWords;
use simulated::sim;
use simulated::trace::Trace;

/// One task under one variant.
#[derive(Clone, Debug)]
pub(super) struct Row {
    pub(super) variant: Variant,
    /// The coefficients; `None` for a model, which has none.
    pub(super) gains: Option<Gains>,
    /// Measures from the event on.
    pub(super) measures: Measures,
    /// The response to the event.
    pub(super) response: Response,
    /// True if the hub reported an encoder fault and released the motor.
    pub(super) fault: bool,
    pub(super) trace: Trace,
}

impl Serialize for Row {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let measures = json!({
            "variant": self.variant,
            "duty": self.variant.duty,
            "regulator": self.variant.regulator.name(),
            "gains": self.gains,
            "settling_s": self.response.settling_s,
            "overshoot_percent": self.response.overshoot_percent,
            "rms_error": self.response.rms_error,
            "peak_jerk_a": self.measures.deceleration_jerk.worst_a,
            "limit_cycle": self.response.swing,
            "energy_returned_j": self.measures.energy_to_battery_j,
            "absolute_error": self.response.absolute_error_s,
            "fault": self.fault,
        });
        with_fields(json!(SchemeWords(self.variant.scheme)), measures).serialize(to)
    }
}

impl Row {
    /// True if the motor did not settle, or if the hub reported an encoder fault.
    pub(super) const fn fails(&self) -> bool {
        self.fault || self.response.settling_s.is_none()
    }

    pub(super) fn settling(&self) -> String {
        if self.fault { "fault".to_owned() } else { table::seconds(self.response.settling_s) }
    }

    /// Runs one task under one variant.
    pub(super) fn of(task: &Task, variant: Variant, gains: Option<Gains>) -> Result<Self, StudyError> {
        let mut scenario = task.scenario.clone();
        for motor in &mut scenario.motors {
            motor.scheme = variant.scheme;
            motor.duty = variant.duty;
            motor.velocity = gains.map(|gains| gains.coefficients(&motor.constants));
        }
        let trace = sim::run(&scenario, &mut |_| ())?;
        let motor = scenario.motors.first().ok_or(StudyError::NoEvent)?;
        let measures = Measures::new(motor, task.event_s..scenario.duration_s, &trace, 0);
        let response = measures.responses.first().ok_or(StudyError::NoEvent)?.clone();
        let fault = trace.motor(0).any(|(_, sample)| sample.report.faults.encoder.is_some());
        Ok(Self { variant, gains, measures, response, fault, trace })
    }
}
