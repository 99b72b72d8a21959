//! The same tasks under every scheme, with linear duty and with linear current: which controls better.
//!
//! One AM 60 A does a few [`tasks`] under each [`Variant`], by the motor's model, and by PID once with the same coefficients for all and
//! once with the best of a small grid for each, chosen on the first task ([`tuning`]). [`score`] says
//! which wins where.

mod charts;
pub mod score;
pub mod tasks;
mod text;
pub mod tuning;

use crate::measures::Measures;
use crate::{NamedFigure, StudyError};
use motor_hub::braking::{Blend, DutyRule, Scheme};
use motor_hub::regulator::Kind;
use serde::Serialize;
use serde_json::json;
use simulated::sim;
use simulated::trace::Trace;
use std::path::PathBuf;
use tasks::Task;
use tuning::{Gains, Tuning};

/// A way to regulate a motor and to turn control values into duties.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variant {
    /// Where the points lie.
    pub scheme: Scheme,
    /// How duties are found between them.
    pub duty: DutyRule,
    /// Where control values come from.
    pub regulator: Kind,
}

impl Variant {
    /// Everything there is to compare: by PID no braking regime, then A to D with either duty; by the model no
    /// braking regime, A and B.
    pub const ALL: [Self; 12] = {
        const fn of(scheme: Scheme, duty: DutyRule) -> Variant {
            Variant { scheme, duty, regulator: Kind::Pid }
        }
        const fn model(scheme: Scheme) -> Variant {
            Variant { scheme, duty: DutyRule::LinearCurrent, regulator: Kind::Model }
        }
        const D: Scheme = Scheme::D(Blend::Automatic);
        [
            of(Scheme::ForwardReverse, DutyRule::LinearDuty),
            of(Scheme::A, DutyRule::LinearDuty),
            of(Scheme::B, DutyRule::LinearDuty),
            of(Scheme::C, DutyRule::LinearDuty),
            of(D, DutyRule::LinearDuty),
            of(Scheme::A, DutyRule::LinearCurrent),
            of(Scheme::B, DutyRule::LinearCurrent),
            of(Scheme::C, DutyRule::LinearCurrent),
            of(D, DutyRule::LinearCurrent),
            model(Scheme::ForwardReverse),
            model(Scheme::A),
            model(Scheme::B),
        ]
    };

    /// Its name in tables and legends.
    pub fn name(self) -> String {
        match (self.scheme, self.duty) {
            (scheme, _) if self.regulator == Kind::Model => format!("{}, model", letter(scheme)),
            (Scheme::ForwardReverse, _) => "none".to_owned(),
            (scheme, DutyRule::LinearDuty) => format!("{}, linear duty", letter(scheme)),
            (scheme, DutyRule::LinearCurrent) => format!("{}, linear current", letter(scheme)),
        }
    }
}

fn letter(scheme: Scheme) -> &'static str {
    match scheme {
        Scheme::ForwardReverse => "none",
        Scheme::A => "A",
        Scheme::B => "B",
        Scheme::C => "C",
        Scheme::D(_) => "D",
    }
}

/// What came of one task under one variant.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The variant's name.
    pub variant: String,
    /// Its coefficients; null for a model, which has none.
    pub gains: Option<Gains>,
    /// Seconds until the speed stays within 2 %; null if it never does.
    pub settling_s: Option<f64>,
    /// Percent of the step, or of the set-point after a change of torque; null at standstill.
    pub overshoot_percent: Option<f64>,
    /// Root mean square of the speed's error from the event on, in counts/s.
    pub rms_error: f64,
    /// Largest change of the mean current between control periods while slowing down, in amperes.
    pub peak_jerk_a: f64,
    /// Peak to peak of the speed in the last second, in counts/s.
    pub limit_cycle: f64,
    /// Energy that went back into the battery from the event on, in joules.
    pub energy_returned_j: f64,
    /// Integral of the error's size from the event on, in counts.
    pub absolute_error: f64,
    /// The hub gave up: an encoder fault.
    pub fault: bool,
    /// The run itself, for the charts.
    #[serde(skip)]
    trace: Trace,
}

/// All variants at one task.
#[derive(Clone, Debug, Serialize)]
pub struct TaskResult {
    /// The task.
    #[serde(flatten)]
    pub task: Task,
    /// In the order of [`Variant::ALL`].
    pub rows: Vec<Row>,
}

/// All tasks with one way of choosing coefficients.
#[derive(Clone, Debug, Serialize)]
pub struct Round {
    /// How coefficients were chosen.
    pub tuning: Tuning,
    /// In the order of the tasks.
    pub tasks: Vec<TaskResult>,
}

/// The whole comparison.
#[derive(Clone, Debug)]
pub struct Comparison {
    rounds: Vec<Round>,
}

/// Runs one task under one variant.
fn run(task: &Task, variant: Variant, gains: Option<Gains>) -> Result<Row, StudyError> {
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
    Ok(Row {
        variant: variant.name(),
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

impl Comparison {
    /// Runs everything, or with `quick` the first three tasks with the same coefficients; `progress` is
    /// told how many of how many runs are done.
    ///
    /// # Errors
    /// If a run fails.
    pub fn new(quick: bool, progress: &mut dyn FnMut(usize, usize)) -> Result<Self, StudyError> {
        let mut tasks = tasks::all()?;
        if quick {
            tasks.truncate(3);
        }
        let round = tasks.len() * Variant::ALL.len();
        let total = if quick { round } else { 2 * round + tuning::runs() };
        let mut done = 0;
        let mut step = || {
            done += 1;
            progress(done, total);
        };
        let mut tunings = vec![Tuning::same()];
        if let (false, Some(first)) = (quick, tasks.first()) {
            tunings.push(Tuning::best(first, &mut step)?);
        }
        let mut rounds = Vec::with_capacity(tunings.len());
        for tuning in tunings {
            let mut results = Vec::with_capacity(tasks.len());
            for task in &tasks {
                let mut rows = Vec::with_capacity(Variant::ALL.len());
                for (variant, &gains) in Variant::ALL.into_iter().zip(&tuning.gains) {
                    rows.push(run(task, variant, gains)?);
                    step();
                }
                results.push(TaskResult { task: task.clone(), rows });
            }
            rounds.push(Round { tuning, tasks: results });
        }
        Ok(Self { rounds })
    }

    /// The tables for people.
    pub fn text(&self) -> String {
        self.rounds.iter().map(text::round).chain([text::verdict(&self.rounds)]).collect()
    }

    /// The document for programs.
    pub fn json(&self, files: &[PathBuf]) -> serde_json::Value {
        let round = |round: &Round| {
            json!({
                "tuning": round.tuning,
                "tasks": round.tasks,
                "winners": score::winners(round),
            })
        };
        json!({
            "rounds": self.rounds.iter().map(round).collect::<Vec<_>>(),
            "scores": score::scores(&self.rounds),
            "files": files,
        })
    }

    /// A chart of each task.
    pub fn figures(&self) -> Vec<NamedFigure> {
        charts::all(&self.rounds)
    }
}
