//! The comparison as text: the verdict first, then the tables.

use super::charts::VARIANT_GROUPS;
use super::gains::Gains;
use super::row::Row;
use super::score::{Score, Winner, scores, winners};
use super::variant::{Variant, in_words};
use super::{Round, TaskResult};
use crate::page::Page;
use crate::table::{self, Table};

/// Explains the other measures below the tables.
const DEFINITIONS: &str = "\
Rms error: of the speed, counts/s. Peak jerk: largest
change of the mean motor current from one control period to the next while the motor slows down, A. Limit cycle: peak
to peak of the speed in the last second, counts/s. Returned: energy into the battery, J. |error|: integral of the
error's size, counts. A variant that brakes least has the least jerk. Fault: the load drove the motor on against full
reverse drive, so the hub took the encoder for reversed and released the motor. Model: regulated by the motor's model
with linear current; it has no coefficients, and motor and load are configured exactly.";

/// Explains all measures below the tables.
fn definitions() -> String {
    format!("All measures are from the task's event on. {} {DEFINITIONS}", crate::settling::definitions())
}

/// Explains the signs of the variants below the table of winners.
const SIGNS: &str = "Capitals: linear current. Small letters: linear duty. ': the motor's model. 0: no braking regime. \
                     *: all variants. -: no variant.";

/// A variant whose mean error is at most this factor times the least one counts as nearly as good.
const NEAR: f64 = 1.25;

/// The verdict, and every measure of every run.
pub(super) fn measures(rounds: &[Round]) -> Page {
    let mut page = verdict(rounds);
    for round in rounds {
        page.table(&format!("Measures with {}", round.tuning.key_in_words()), all_measures(round));
        page.text(&setting(round));
        winners_of(&mut page, round);
    }
    page.text(&definitions());
    page
}

/// The verdict, and the settling times by task and variant.
pub(super) fn settling(rounds: &[Round]) -> Page {
    let mut page = verdict(rounds);
    // In a full comparison the last round has each variant's best coefficients. This round is shown first.
    for (number, round) in rounds.iter().rev().enumerate() {
        // The model has no coefficients. Its runs are the same in every round, and are shown once.
        let groups = VARIANT_GROUPS.into_iter().filter(|(_, shown)| {
            number == 0 || Variant::ALL.iter().any(|variant| shown(variant) && variant.has_coefficients())
        });
        for (name, shown) in groups {
            let caption = format!("Settling, {name}, with {}", round.tuning.key_in_words());
            page.table(&caption, settling_times(round, shown));
        }
        page.text(&setting(round));
        winners_of(&mut page, round);
    }
    page.text(&definitions());
    page
}

/// States which variant is the best, at which tasks another variant is better, and which variant is the last. The
/// tables of scores and tasks follow.
fn verdict(rounds: &[Round]) -> Page {
    let scores = scores(rounds);
    let tasks: &[TaskResult] = rounds.first().map_or(&[], |round| &round.tasks);
    let (Some(best), Some(last)) = (scores.first(), scores.last()) else {
        return Page::new("There is nothing to compare.");
    };
    let mut page = Page::new(format!(
        "{} wins: it has the least error on average over {} tasks{}.",
        in_words(&best.variant),
        tasks.len(),
        beaten_at(best, tasks)
    ));
    let near = || scores.iter().filter(|score| score.error_ratio <= NEAR * best.error_ratio);
    let lowest = |value: fn(&Score) -> f64| near().min_by(|a, b| value(a).total_cmp(&value(b)));
    let of_near = [
        ("Least error at its worst task", lowest(|score| score.worst_ratio)),
        ("Least jerk", lowest(|score| score.mean_jerk_a)),
    ];
    let percent = 100.0 * (NEAR - 1.0);
    let near = of_near.into_iter().filter_map(|(what, score)| {
        Some(format!("{what}, among the variants within {percent:.0} % of it: {}.", with_gains(score?)))
    });
    let losses = |score: &Score| {
        let all = tasks.len();
        format!(
            "{:.1} times the least error on average, not settled at {} of {all} tasks",
            score.error_ratio, score.failures
        )
    };
    let without = scores.iter().find(|score| score.variant.starts_with("none"));
    let without = without.map(|score| {
        format!("The best without a braking regime is \"{}\": {}.", with_gains(score), losses(score))
    });
    let loses = format!("The last is \"{}\": {}.", with_gains(last), losses(last));
    page.list(near.chain(without).chain([loses]));
    page.table("Scores, the least error first", scores_table(&scores, tasks));
    page.text(
        "|error|, mean: geometric mean over the tasks of the ratio to the least |error| of all variants at the task. \
         Cells won: best in a column of a task, alone or with others.",
    );
    for round in rounds {
        page.heading(&format!("Best at most tasks, with {}", round.tuning.key_in_words()));
        let columns = ["settling", "overshoot", "rms error", "peak jerk", "limit cycle", "returned"];
        page.list(columns.map(|column| format!("{column}: {}", most_often(round, column))));
    }
    let mut what = table::new(&["task", "what happens"], 2);
    for result in tasks {
        what.add_row([result.task.key, result.task.what.as_str()]);
    }
    page.table("Tasks", what);
    page
}

/// The tasks at which the error of another variant is less by more than [`NEAR`], as the end of a sentence.
fn beaten_at(best: &Score, tasks: &[TaskResult]) -> String {
    let names: Vec<&str> = tasks
        .iter()
        .zip(&best.ratios)
        .filter(|(_, ratio)| **ratio > NEAR)
        .map(|(result, _)| result.task.key)
        .collect();
    let Some((last, first)) = names.split_last() else {
        return ", and no variant is clearly better at any task".to_owned();
    };
    let first = first.join(", ");
    let and = if first.is_empty() { "" } else { " and " };
    format!("; another variant is clearly better at {first}{and}{last}")
}

fn with_gains(score: &Score) -> String {
    let name = in_words(&score.variant);
    score.gains.map_or_else(|| name.clone(), |Gains { p, i }| format!("{name} with P = {p} f, I = {i} f"))
}

fn scores_table(scores: &[Score], tasks: &[TaskResult]) -> Table {
    let headings = [
        "variant",
        "P/f",
        "I/f",
        "|error|, mean",
        "worst",
        "worst at",
        "peak jerk, mean",
        "not settled",
        "cells won",
    ];
    let mut table = table::new(&headings, 1);
    for score in scores {
        let [p, i] = words(score.gains);
        let worst = score.ratios.iter().zip(tasks).max_by(|a, b| a.0.total_cmp(b.0));
        let worst = worst.filter(|(ratio, _)| **ratio >= 1.005);
        table.add_row([
            in_words(&score.variant),
            p,
            i,
            format!("{:.2}", score.error_ratio),
            format!("{:.2}", score.worst_ratio),
            worst.map_or("-", |(_, result)| result.task.key).to_owned(),
            format!("{:.2} A", score.mean_jerk_a),
            score.failures.to_string(),
            score.wins.to_string(),
        ]);
    }
    table
}

fn setting(round: &Round) -> String {
    format!(
        "A NeveRest 60 (measured rotor inertia) with a 10 kg flywheel (0.05 kg m2), control period 50 ms, battery 12 V \
         behind 0.05 ohm; {}; D = F = 0; f = 32767 keFw / 12000 steps per count/s.",
        round.tuning.how
    )
}

fn all_measures(round: &Round) -> Table {
    let headings = [
        "task",
        "variant",
        "P/f",
        "I/f",
        "settling",
        "overshoot",
        "rms error",
        "peak jerk",
        "limit cycle",
        "returned",
        "|error|",
    ];
    let mut table = table::new(&headings, 2);
    for result in &round.tasks {
        for (number, row) in result.rows.iter().enumerate() {
            let task = if number == 0 { result.task.key } else { "" };
            table.add_row([[task.to_owned(), in_words(&row.variant)].to_vec(), cells(row)].concat());
        }
    }
    table
}

fn cells(row: &Row) -> Vec<String> {
    let [p, i] = words(row.gains);
    vec![
        p,
        i,
        row.settling(),
        table::percent(row.overshoot_percent),
        format!("{:.1}", row.rms_error),
        format!("{:.2}", row.peak_jerk_a),
        format!("{:.1}", row.limit_cycle),
        format!("{:.2}", row.energy_returned_j),
        format!("{:.0}", row.absolute_error),
    ]
}

/// P and I as multiples of `f`, as text for tables; "-" for the model.
fn words(gains: Option<Gains>) -> [String; 2] {
    gains.map_or(["-".to_owned(), "-".to_owned()], |Gains { p, i }| [p.to_string(), i.to_string()])
}

fn settling_times(round: &Round, shown: fn(&Variant) -> bool) -> Table {
    let variants: Vec<usize> =
        Variant::ALL.iter().enumerate().filter(|(_, v)| shown(v)).map(|(index, _)| index).collect();
    let names: Vec<String> = variants
        .iter()
        .filter_map(|index| Variant::ALL.get(*index))
        .map(|variant| in_words(&variant.name()))
        .collect();
    let headings: Vec<&str> = ["task"].into_iter().chain(names.iter().map(String::as_str)).collect();
    let mut table = table::new(&headings, 1);
    for result in &round.tasks {
        let times = variants.iter().filter_map(|index| result.rows.get(*index)).map(Row::settling);
        table.add_row([result.task.key.to_owned()].into_iter().chain(times));
    }
    table
}

fn winners_of(page: &mut Page, round: &Round) {
    let winners = winners(round);
    let columns: Vec<&str> = winners
        .iter()
        .take_while(|w| Some(w.task) == winners.first().map(|f| f.task))
        .map(|w| w.column)
        .collect();
    let mut table = table::new(&[&["task"], &columns[..]].concat(), columns.len() + 1);
    let all = round.tasks.first().map_or(0, |result| result.rows.len());
    for task in winners.chunk_by(|a, b| a.task == b.task) {
        let name = task.first().map_or("", |w| w.task).to_owned();
        table.add_row([vec![name], task.iter().map(|w| short(w, all)).collect()].concat());
    }
    page.table(&format!("Winners with {}", round.tuning.key_in_words()), table);
    page.text(SIGNS);
}

/// The winners of a cell by the signs that [`SIGNS`] explains.
fn short(winner: &Winner, all: usize) -> String {
    match winner.variants.len() {
        0 => "-".to_owned(),
        n if n == all => "*".to_owned(),
        _ => {
            let sign = |name: &String| {
                let (scheme, rule) = name.split_once(", ").unwrap_or((name, ""));
                let scheme = if scheme == "none" { "0" } else { scheme };
                match rule {
                    "linear duty" => scheme.to_lowercase(),
                    "model" => format!("{scheme}'"),
                    _ => scheme.to_owned(),
                }
            };
            winner.variants.iter().map(sign).collect::<Vec<_>>().join(" ")
        }
    }
}

/// The variants that are the best in a column most often, and at how many tasks they are.
fn most_often(round: &Round, column: &str) -> String {
    // A cell where all are equal, or none succeeds, has no winner.
    let decided = |w: &Winner| w.column == column && (1..Variant::ALL.len()).contains(&w.variants.len());
    let winners: Vec<Winner> = winners(round).into_iter().filter(decided).collect();
    let counted: Vec<(usize, String)> = Variant::ALL
        .into_iter()
        .map(|variant| variant.name())
        .map(|name| (winners.iter().filter(|w| w.variants.contains(&name)).count(), name))
        .collect();
    let most = counted.iter().map(|c| c.0).max().unwrap_or(0);
    let best: Vec<String> = counted.iter().filter(|c| c.0 == most).map(|c| in_words(&c.1)).collect();
    format!("{} ({most} of {})", best.join("; "), winners.len())
}
