//! The results of all runs, by task and by choice of coefficients.

use super::row::Row;
use super::tasks::Task;
use super::tuning::Tuning;
use serde::Serialize;

/// All variants at one task.
#[derive(Clone, Debug, Serialize)]
pub(super) struct TaskResult {
    /// The task.
    #[serde(flatten)]
    pub(super) task: Task,
    /// In the order of [`Variant::ALL`](super::variant::Variant::ALL).
    pub(super) rows: Vec<Row>,
}

/// All tasks with one way of choosing coefficients.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Round {
    /// How coefficients were chosen.
    pub(super) tuning: Tuning,
    /// In the order of the tasks.
    pub(super) tasks: Vec<TaskResult>,
}
