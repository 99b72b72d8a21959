//! The comparison as text: the verdict first, then the tables.

use super::charts::VARIANT_GROUPS;
use super::row::Row;
use super::score::{COLUMNS, Score, Winner, scores, winners};
use super::tuning::Gains;
use super::variant::Variant;
use super::{Round, TaskResult};
use crate::page::Page;
use crate::table::{self, Table};
use motor_hub::braking::Scheme;

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
        page.table(&format!("Measures with {}", round.tuning.key_in_words), all_measures(round));
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
            let caption = format!("Settling, {name}, with {}", round.tuning.key_in_words);
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
        best.variant.in_words(),
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
    let without = scores.iter().find(|score| score.variant.scheme == Scheme::ForwardReverse);
    let without = without.map(|score| {
        format!("The best without a braking regime is \"{}\": {}.", with_gains(score), losses(score))
    });
    let loses = format!("The last is \"{}\": {}.", with_gains(last), losses(last));
    page.list(near.chain(without).chain([loses]));
    page.table("Scores, the least error first", scores_table(&scores, tasks));
    page.text(
        "|error|, mean: geometric mean over the tasks of the ratio to the least |error| of all variants at the task. \
         1 count is added to each |error|, so that variants with hardly any error tie. Cells won: best in a column of a \
         task, alone or with others.",
    );
    for round in rounds {
        page.heading(&format!("Best at most tasks, with {}", round.tuning.key_in_words));
        page.list(COLUMNS.map(|column| format!("{}: {}", column.name, most_often(round, column.name))));
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
    let name = score.variant.in_words();
    score.gains.map_or_else(|| name.clone(), |Gains { p, i }| format!("{name} with P = {p} f, I = {i} f"))
}

fn scores_table(scores: &[Score], tasks: &[TaskResult]) -> Table {
    let worst_at = |score: &Score| {
        let worst = score.ratios.iter().zip(tasks).max_by(|a, b| a.0.total_cmp(b.0));
        worst.filter(|(ratio, _)| **ratio >= 1.005).map_or("-", |(_, result)| result.task.key).to_owned()
    };
    table::of(
        scores,
        1,
        &[
            ("variant", &|score| score.variant.in_words()),
            ("P/f", &|score| factor(score.gains, |gains| gains.p)),
            ("I/f", &|score| factor(score.gains, |gains| gains.i)),
            ("|error|, mean", &|score| format!("{:.2}", score.error_ratio)),
            ("worst", &|score| format!("{:.2}", score.worst_ratio)),
            ("worst at", &|score| worst_at(score)),
            ("peak jerk, mean", &|score| format!("{:.2} A", score.mean_jerk_a)),
            ("not settled", &|score| score.failures.to_string()),
            ("cells won", &|score| score.wins.to_string()),
        ],
    )
}

fn setting(round: &Round) -> String {
    format!(
        "A NeveRest 60 (measured rotor inertia) with a 10 kg flywheel (0.05 kg m2), control period 50 ms, battery 12 V \
         behind 0.05 ohm; {}; D = F = 0; f = 32767 keFw / 12000 steps per count/s.",
        round.tuning.how
    )
}

fn all_measures(round: &Round) -> Table {
    let rows = round.tasks.iter().flat_map(|result| {
        let named = |(number, row)| (if number == 0 { result.task.key } else { "" }, row);
        result.rows.iter().enumerate().map(named)
    });
    table::of(
        rows,
        2,
        &[
            ("task", &|(task, _)| (*task).to_owned()),
            ("variant", &|(_, row)| row.variant.in_words()),
            ("P/f", &|(_, row)| factor(row.gains, |gains| gains.p)),
            ("I/f", &|(_, row)| factor(row.gains, |gains| gains.i)),
            ("settling", &|(_, row)| row.settling()),
            ("overshoot", &|(_, row)| table::percent(row.response.overshoot_percent)),
            ("rms error", &|(_, row)| format!("{:.1}", row.response.rms_error)),
            ("peak jerk", &|(_, row)| format!("{:.2}", row.measures.deceleration_jerk.worst_a)),
            ("limit cycle", &|(_, row)| format!("{:.1}", row.response.swing)),
            ("returned", &|(_, row)| format!("{:.2}", row.measures.energy_to_battery_j)),
            ("|error|", &|(_, row)| format!("{:.0}", row.response.absolute_error_s)),
        ],
    )
}

/// P or I as a multiple of `f`, as text for tables; "-" for the model.
fn factor(gains: Option<Gains>, of: fn(Gains) -> f64) -> String {
    gains.map_or("-".to_owned(), |gains| of(gains).to_string())
}

fn settling_times(round: &Round, shown: fn(&Variant) -> bool) -> Table {
    let names = Variant::ALL.into_iter().filter(shown).map(Variant::in_words);
    let mut table = table::new(["task".to_owned()].into_iter().chain(names), 1);
    for result in &round.tasks {
        let times = result.rows.iter().filter(|row| shown(&row.variant)).map(Row::settling);
        table.add_row([result.task.key.to_owned()].into_iter().chain(times));
    }
    table
}

fn winners_of(page: &mut Page, round: &Round) {
    let columns = COLUMNS.map(|column| column.name);
    let mut table = table::new(["task"].into_iter().chain(columns), 1 + columns.len());
    for (result, winners) in round.tasks.iter().zip(winners(round).chunks(COLUMNS.len())) {
        table.add_row([result.task.key.to_owned()].into_iter().chain(winners.iter().map(signs)));
    }
    page.table(&format!("Winners with {}", round.tuning.key_in_words), table);
    page.text(SIGNS);
}

/// The winners of a cell by the signs that [`SIGNS`] explains.
fn signs(winner: &Winner) -> String {
    match winner.variants.len() {
        0 => "-".to_owned(),
        all if all == Variant::ALL.len() => "*".to_owned(),
        _ => winner.variants.iter().map(|variant| variant.sign).collect::<Vec<_>>().join(" "),
    }
}

/// The variants that are the best in a column most often, and at how many tasks they are.
fn most_often(round: &Round, column: &str) -> String {
    // A cell where all are equal, or none succeeds, has no winner.
    let decided = |w: &Winner| w.column == column && (1..Variant::ALL.len()).contains(&w.variants.len());
    let winners: Vec<Winner> = winners(round).into_iter().filter(decided).collect();
    let wins = |variant: &Variant| winners.iter().filter(|w| w.variants.contains(variant)).count();
    let most = Variant::ALL.iter().map(wins).max().unwrap_or(0);
    let best: Vec<String> =
        Variant::ALL.into_iter().filter(|variant| wins(variant) == most).map(Variant::in_words).collect();
    format!("{} ({most} of {})", best.join("; "), winners.len())
}
