//! Finds the best variants at each task by the measures alone, and scores all variants.

use super::Round;
use super::row::Row;
use super::tuning::Gains;
use super::variant::Variant;
use serde::Serialize;

/// A column of the table of winners.
pub(super) struct Column {
    pub(super) name: &'static str,
    /// Measure of a run; the smallest is the best. `None` if the task has no such measure, or if the motor did not
    /// settle.
    value: fn(&Row) -> Option<f64>,
    /// Differences up to this count as a tie.
    tie: f64,
}

/// Differences up to half a control period, half a percent, one count per second, and a hundredth of an ampere or of a
/// joule are ties.
pub(super) const COLUMNS: [Column; 6] = [
    Column { name: "settling", value: |r| r.response.settling_s, tie: 0.026 },
    Column { name: "overshoot", value: |r| r.response.overshoot_percent, tie: 0.5 },
    Column { name: "rms error", value: |r| Some(r.response.rms_error), tie: 1.0 },
    Column { name: "peak jerk", value: |r| Some(r.measures.deceleration_jerk.worst_a), tie: 0.01 },
    Column { name: "limit cycle", value: |r| Some(r.response.swing), tie: 1.0 },
    Column { name: "returned", value: |r| Some(-r.measures.energy_to_battery_j), tie: 0.01 },
];

/// Counts that are added to each integral of |error|, so that variants with hardly any error tie.
const NEGLIGIBLE: f64 = 1.0;

/// The best variants at one task in one column.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Winner {
    /// Name of the task in files.
    pub(super) task: &'static str,
    pub(super) column: &'static str,
    /// The best variant, and all variants that tie with it; empty if no variant has this measure without a fault.
    pub(super) variants: Vec<Variant>,
}

/// The results of a variant over all tasks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Score {
    pub(super) variant: Variant,
    /// The coefficients; null for a model.
    pub(super) gains: Option<Gains>,
    /// Geometric mean, over the tasks, of a ratio: the variant's integral of |error| to the least integral of all
    /// variants in all rounds.
    pub(super) error_ratio: f64,
    /// Largest of the ratios at all tasks, at least 1.
    pub(super) worst_ratio: f64,
    /// Mean of the variant's peak jerk over the tasks, in amperes.
    pub(super) mean_jerk_a: f64,
    /// Number of cells of task and column in which the variant is best of its round, alone or with others.
    pub(super) wins: usize,
    /// Number of tasks at which the variant does not settle, or at which the hub reports an encoder fault.
    #[serde(skip)]
    pub(super) failures: usize,
    /// By task, ratio of the variant's integral of |error| to the least integral of all variants in all rounds.
    #[serde(skip)]
    pub(super) ratios: Vec<f64>,
}

/// The winners, by task and column.
pub(super) fn winners(round: &Round) -> Vec<Winner> {
    let mut winners = Vec::new();
    for result in &round.tasks {
        for column in &COLUMNS {
            let values = || result.rows.iter().filter(|row| !row.fault).filter_map(column.value);
            let best = values().fold(f64::INFINITY, f64::min);
            let tied = |row: &&Row| !row.fault && (column.value)(row).is_some_and(|v| v <= best + column.tie);
            winners.push(Winner {
                task: result.task.key,
                column: column.name,
                variants: result.rows.iter().filter(tied).map(|row| row.variant).collect(),
            });
        }
    }
    winners
}

/// Scores of every variant with every choice of coefficients, sorted by ascending error. The least error of a task is
/// the least of all rounds.
pub(super) fn scores(rounds: &[Round]) -> Vec<Score> {
    let mut scores: Vec<Score> = Vec::new();
    for round in rounds {
        let winners = winners(round);
        for (index, variant) in Variant::ALL.into_iter().enumerate() {
            let rows: Vec<&Row> = round.tasks.iter().filter_map(|result| result.rows.get(index)).collect();
            let Some(gains) = rows.first().map(|row| row.gains) else { continue };
            if scores.iter().any(|score| score.variant == variant && score.gains == gains) {
                continue;
            }
            let ratios: Vec<f64> =
                rows.iter().enumerate().map(|(task, row)| error(row) / least(rounds, task)).collect();
            let many = ratios.len().max(1) as f64;
            scores.push(Score {
                variant,
                gains,
                error_ratio: (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / many).exp(),
                worst_ratio: ratios.iter().copied().fold(1.0, f64::max),
                mean_jerk_a: rows.iter().map(|row| row.measures.deceleration_jerk.worst_a).sum::<f64>()
                    / many,
                failures: rows.iter().filter(|row| row.fails()).count(),
                ratios,
                wins: winners.iter().filter(|winner| winner.variants.contains(&variant)).count(),
            });
        }
    }
    scores.sort_by(|a, b| a.error_ratio.total_cmp(&b.error_ratio));
    scores
}

fn error(row: &Row) -> f64 {
    row.response.absolute_error_s + NEGLIGIBLE
}

/// The least error at a task in any round.
fn least(rounds: &[Round], task: usize) -> f64 {
    let rows = rounds.iter().filter_map(|round| round.tasks.get(task)).flat_map(|result| &result.rows);
    rows.map(error).fold(f64::INFINITY, f64::min)
}
