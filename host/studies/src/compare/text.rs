//! The comparison as tables for people, and what follows from it in words.

use super::gains::Gains;
use super::results::Round;
use super::row::Row;
use super::score::{Score, Winner, scores, winners};
use super::variant::Variant;
use crate::table;

const DEFINITIONS: &str = "\
Judged from the event on. Settling: until the speed stays within 2 % of the larger of old and new speed.
Overshoot: beyond the set-point in % of the step; after a change of torque the largest deviation in % of
the set-point. Rms error: of the speed, counts/s. Peak jerk: largest change of the mean motor current from
one control period to the next while the motor slows down, A. Limit cycle: peak to peak of the speed in
the last second, counts/s. Returned: energy into the battery, J. |error|: its integral, counts. Little jerk
is no merit by itself: who brakes least has least. Fault: the load drove the motor on against full reverse of
the bridge, so the hub took the encoder for reversed and let go. Model: regulated by the motor's model, with linear
current; it has no coefficients, and is told the motor and its load as they are.";

const SIGNS: &str = "Capitals are linear current, small letters linear duty, ' is by the motor's model; * is everybody, - nobody.";

/// One round: its table, who wins where, and the scores.
pub(super) fn round(round: &Round) -> String {
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
            table.add_row([[task.to_owned(), row.variant.clone()].to_vec(), cells(row)].concat());
        }
    }
    let tasks: String =
        round.tasks.iter().map(|result| format!("  {:12} {}\n", result.task.key, result.task.what)).collect();
    let setting = format!(
        "An AM 60 A (measured rotor inertia) with a 10 kg flywheel (0.05 kg m2), 50 ms, 12 V behind 0.05 ohm; {}; D = F = 0, f = \
         32767 keFw / 12000 steps per count/s",
        round.tuning.how
    );
    format!(
        "{}\n{tasks}{table}\n{}\n\n{}\n{}\n\n",
        table::paragraph(&setting),
        table::paragraph(DEFINITIONS),
        table::paragraph(SIGNS),
        who_wins(round),
    )
}

fn cells(row: &Row) -> Vec<String> {
    let [p, i] = words(row.gains);
    let settling = match row.settling_s {
        _ if row.fault => "fault".to_owned(),
        Some(s) => format!("{s:.2} s"),
        None if row.overshoot_percent.is_none() => "-".to_owned(),
        None => "never".to_owned(),
    };
    vec![
        p,
        i,
        settling,
        row.overshoot_percent.map_or("-".to_owned(), |percent| format!("{percent:.1} %")),
        format!("{:.1}", row.rms_error),
        format!("{:.2}", row.peak_jerk_a),
        format!("{:.1}", row.limit_cycle),
        format!("{:.2}", row.energy_returned_j),
        format!("{:.0}", row.absolute_error),
    ]
}

/// P and I as they stand in tables.
fn words(gains: Option<Gains>) -> [String; 2] {
    gains.map_or(["-".to_owned(), "-".to_owned()], |Gains { p, i }| [p.to_string(), i.to_string()])
}

fn who_wins(round: &Round) -> String {
    let winners = winners(round);
    let columns: Vec<&str> = winners
        .iter()
        .take_while(|w| Some(w.task) == winners.first().map(|f| f.task))
        .map(|w| w.column)
        .collect();
    let mut table = table::new(&[&["best at"], &columns[..]].concat(), columns.len() + 1);
    let all = round.tasks.first().map_or(0, |result| result.rows.len());
    for task in winners.chunk_by(|a, b| a.task == b.task) {
        let name = task.first().map_or("", |w| w.task).to_owned();
        table.add_row([vec![name], task.iter().map(|w| short(w, all)).collect()].concat());
    }
    table.to_string()
}

/// A, B, C, D with linear duty as lower-case letters, with linear current as capitals, by the model with a stroke.
fn short(winner: &Winner, all: usize) -> String {
    match winner.variants.len() {
        0 => "-".to_owned(),
        n if n == all => "*".to_owned(),
        _ => {
            let letter = |name: &String| match name.split_once(", ") {
                Some((letter, "linear duty")) => letter.to_lowercase(),
                Some((letter, "model")) => format!("{letter}'"),
                Some((letter, _)) => letter.to_owned(),
                None => name.clone(),
            };
            winner.variants.iter().map(letter).collect::<Vec<_>>().join(" ")
        }
    }
}

/// All variants with all their coefficients in one order, and which defaults follow.
pub(super) fn verdict(rounds: &[Round]) -> String {
    let scores = scores(rounds);
    let headings =
        ["variant", "P/f", "I/f", "|error| to the least, mean", "worst", "peak jerk, mean", "cells won"];
    let mut table = table::new(&headings, 1);
    for score in &scores {
        let [p, i] = words(score.gains);
        table.add_row([
            score.variant.clone(),
            p,
            i,
            format!("{:.2}", score.error_ratio),
            format!("{:.2}", score.worst_ratio),
            format!("{:.2} A", score.mean_jerk_a),
            score.wins.to_string(),
        ]);
    }
    let mut out = table::paragraph(
        "All of it, the least error first; the mean is geometric, over the tasks, to the least of all at each.",
    );
    out.push_str(&format!("\n{table}\n"));
    let name = |score: &Score| match score.gains {
        Some(Gains { p, i }) => format!("{} with P = {p} f, I = {i} f", score.variant),
        None => score.variant.clone(),
    };
    if let Some(best) = scores.first() {
        let near = || scores.iter().filter(|score| score.error_ratio <= NEAR * best.error_ratio);
        let lowest = |value: fn(&Score) -> f64| near().min_by(|a, b| value(a).total_cmp(&value(b)));
        out.push_str(&format!("Least error on average: {}.\n", name(best)));
        for (what, chosen) in [
            ("least at its worst task", lowest(|score| score.worst_ratio)),
            ("gentlest", lowest(|score| score.mean_jerk_a)),
        ] {
            let chosen = chosen.map(name).unwrap_or_default();
            out.push_str(&format!("Within {:.0} % of that, {what}: {chosen}.\n", 100.0 * (NEAR - 1.0)));
        }
    }
    for round in rounds {
        out.push_str(&format!("With {}, best at most tasks:\n", round.tuning.key_in_words()));
        for column in ["settling", "overshoot", "rms error", "peak jerk", "limit cycle", "returned"] {
            out.push_str(&format!("  {column:12} {}\n", most_often(round, column)));
        }
    }
    out
}

/// Mean errors within this factor are near.
const NEAR: f64 = 1.25;

/// Who wins a column at most tasks.
fn most_often(round: &Round, column: &str) -> String {
    // Where all are equal, or none succeeds, nobody wins.
    let decided = |w: &Winner| w.column == column && (1..Variant::ALL.len()).contains(&w.variants.len());
    let winners: Vec<Winner> = winners(round).into_iter().filter(decided).collect();
    let counted: Vec<(usize, String)> = Variant::ALL
        .into_iter()
        .map(|variant| variant.name())
        .map(|name| (winners.iter().filter(|w| w.variants.contains(&name)).count(), name))
        .collect();
    let most = counted.iter().map(|c| c.0).max().unwrap_or(0);
    let best: Vec<&str> = counted.iter().filter(|c| c.0 == most).map(|c| c.1.as_str()).collect();
    format!("{} ({most} of {})", best.join("; "), winners.len())
}
