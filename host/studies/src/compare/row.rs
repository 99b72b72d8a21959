//! One run of the comparison, and its measures.

use super::tasks::Task;
use super::tuning::Gains;
use super::variant::Variant;
use crate::StudyError;
use crate::measures::Measures;
use crate::table;
use motor_hub::braking::DutyRule;
use serde::Serialize;
use simulated::scheme::SchemeWords;
use simulated::sim;
use simulated::trace::Trace;

/// The measures of one task under one variant.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    /// The variant.
    pub(super) variant: Variant,
    /// Scheme of the variant.
    #[serde(flatten)]
    scheme: SchemeWords,
    /// Duty rule of the variant.
    duty: DutyRule,
    /// Regulator of the variant, "model" or "PID".
    regulator: &'static str,
    /// The coefficients; null for a model, which has none.
    pub(super) gains: Option<Gains>,
    /// Seconds until the motor has [settled](crate::settling); null if it never settles.
    pub(super) settling_s: Option<f64>,
    /// Overshoot in percent of the step, or of the set-point after a change of torque; null at standstill.
    pub(super) overshoot_percent: Option<f64>,
    /// Root mean square of the speed's error from the event on, in counts/s.
    pub(super) rms_error: f64,
    /// Largest change of the mean current between control periods while slowing down, in amperes.
    pub(super) peak_jerk_a: f64,
    /// Difference of the highest and the lowest speed in the last second, in counts/s.
    pub(super) limit_cycle: f64,
    /// Energy returned to the battery from the event on, in joules.
    pub(super) energy_returned_j: f64,
    /// Integral of the error's magnitude from the event on, in counts.
    pub(super) absolute_error: f64,
    /// True if the hub reported an encoder fault and released the motor.
    pub(super) fault: bool,
    /// The run itself, for the charts.
    #[serde(skip)]
    pub(super) trace: Trace,
}

impl Row {
    /// True if the motor did not settle, or if the hub reported an encoder fault.
    pub(super) const fn fails(&self) -> bool {
        self.fault || self.settling_s.is_none()
    }

    /// The settling time as text.
    pub(super) fn settling(&self) -> String {
        if self.fault { "fault".to_owned() } else { table::seconds(self.settling_s) }
    }

    /// Runs one task under one variant.
    ///
    /// # Errors
    /// If the run fails.
    pub(super) fn of(task: &Task, variant: Variant, gains: Option<Gains>) -> Result<Self, StudyError> {
        let mut scenario = task.scenario.clone();
        for motor in &mut scenario.motors {
            motor.scheme = variant.scheme;
            motor.duty = variant.duty;
            motor.velocity = gains.map(|gains| gains.coefficients(&motor.constants));
        }
        let trace = sim::run(&scenario, &mut |_| ())?;
        let motor = scenario.motors.first().ok_or(StudyError::NoEvent)?;
        let measures = Measures::between(motor, task.event_s..scenario.duration_s, &trace, 0);
        let response = measures.responses.first().ok_or(StudyError::NoEvent)?;
        let fault = trace.motor(0).any(|(_, sample)| sample.report.faults.encoder.is_some());
        Ok(Self {
            variant,
            scheme: SchemeWords(variant.scheme),
            duty: variant.duty,
            regulator: variant.regulator.name(),
            gains,
            settling_s: response.settling_s,
            overshoot_percent: response.overshoot_percent,
            rms_error: response.rms_error,
            peak_jerk_a: measures.deceleration_jerk.worst_a,
            limit_cycle: response.swing,
            energy_returned_j: measures.energy_to_battery_j,
            absolute_error: response.absolute_error_s,
            fault,
            trace,
        })
    }
}
