//! Compares schemes and duty rules at the same tasks.
//!
//! One NeveRest 60 does a few tasks in several variants. A variant is a scheme, a duty rule and a regulator: the
//! motor's model, or PID. PID has the same coefficients for all variants in one round, and each variant's best
//! coefficients of a small grid in another round. The best coefficients are chosen on the first task. Scores rank the
//! variants.

mod charts;
mod row;
mod score;
mod tasks;
mod text;
mod tuning;
mod variant;

use crate::StudyError;
use row::Row;
use serde::Serialize;
use serde_json::json;
use tasks::Task;
use tuning::Tuning;
use variant::Variant;

/// The runs of all variants at one task.
#[derive(Clone, Debug, Serialize)]
struct TaskResult {
    #[serde(flatten)]
    task: Task,
    /// One run for each variant, in the order of [`Variant::ALL`].
    rows: Vec<Row>,
}

/// The runs of all tasks with one way of choosing coefficients.
#[derive(Clone, Debug, Serialize)]
struct Round {
    tuning: Tuning,
    /// One result for each task, in the order of the tasks.
    tasks: Vec<TaskResult>,
}

/// The whole comparison.
#[derive(Clone, Debug)]
pub struct Comparison {
    rounds: Vec<Round>,
}

impl Comparison {
    /// Runs all tasks in both rounds. With `quick`, runs the first three tasks with the same coefficients only.
    /// `progress` gets the number of finished runs and the number of all runs.
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
        let mut rounds = Vec::new();
        for tuning in tunings {
            let mut results = Vec::new();
            for task in &tasks {
                let mut rows = Vec::new();
                for (variant, &gains) in Variant::ALL.into_iter().zip(&tuning.gains) {
                    rows.push(Row::of(task, variant, gains)?);
                    step();
                }
                results.push(TaskResult { task: task.clone(), rows });
            }
            rounds.push(Round { tuning, tasks: results });
        }
        Ok(Self { rounds })
    }

    /// The verdict and all tables, for a terminal.
    pub fn text(&self) -> String {
        text::measures(&self.rounds).terminal()
    }

    /// The verdict, and the tables that fit a page, as GitHub Markdown.
    pub fn markdown(&self) -> String {
        text::settling(&self.rounds).markdown()
    }

    /// The results as JSON, for programs.
    pub fn json(&self, files: &[String]) -> serde_json::Value {
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
}
