//! Writes the table of the fault matrix for `docs/results`.

use std::fmt::Write;

use super::modes::{MODES, Mode};
use super::rows::{During, Recovery, Row};
use super::run::{MotorResult, OtherResult, RowResult};

/// Rows of Markdown. In a chain they name the hub with the fault, and the answers of the other hub.
pub(crate) fn text<'a>(rows: impl Iterator<Item = (&'a Row, &'a RowResult)>) -> String {
    let mut rows = rows.peekable();
    let in_chain = rows.peek().is_some_and(|(_, seen)| seen.other.is_some());
    let mut heads = MODES.map(Mode::name).to_vec();
    heads.extend(["reported", "back"]);
    heads.extend(in_chain.then_some("the other hub answers within"));
    let mut out = format!("| | {} |\n|{}\n", heads.join(" | "), "---|".repeat(1 + heads.len()));
    for (row, seen) in rows {
        let expected = row.cells.iter().map(|expected| expected.during);
        let mut cells: Vec<String> = seen.cells.iter().zip(expected).map(cell).collect();
        let mut reports = seen.reports.clone();
        let mut back: Vec<&str> = Vec::new();
        for cell in &seen.cells {
            reports.extend(&cell.reports);
            back.push(cell.back.map_or("not", Recovery::name));
        }
        cells.extend([once(reports), once(back)]);
        cells.extend(seen.other.as_ref().map(answers));
        let place = match seen.other {
            None => "",
            Some(OtherResult { fault_in_parent: true, .. }) => ", in the parent",
            Some(OtherResult { fault_in_parent: false, .. }) => ", in the child",
        };
        // Writing to a string does not fail.
        let _ = writeln!(out, "| {}{place} | {} |", row.name, cells.join(" | "));
    }
    out
}

fn cell((seen, expected): (&MotorResult, During)) -> String {
    // Adding 0 turns a negative zero into a positive zero.
    let speed = format!("{:.0} counts/s", seen.speed.round() + 0.0);
    match (seen.open_after, seen.shorted_after) {
        (Some(after), _) => format!("open after {:.0} ms", after.as_secs_f64() * 1e3),
        (_, Some(after)) => format!("shorted after {:.0} ms, {speed}", after.as_secs_f64() * 1e3),
        (None, None) if matches!(expected, During::TurnsOnAverage(..)) => {
            format!("{:.0} counts/s on average", seen.mean_speed)
        }
        (None, None) => speed,
    }
}

fn answers(other: &OtherResult) -> String {
    let slowest = format!("{:.2} ms", other.slowest.as_secs_f64() * 1e3);
    let stops = if other.disturbed.is_empty() { "" } else { ", its motors stop" };
    match other.unanswered {
        0 => format!("{slowest}{stops}"),
        unanswered => format!("{slowest}, {unanswered} requests lost{stops}"),
    }
}

/// Returns the words without repetitions and without empty words.
fn once(words: Vec<&str>) -> String {
    let mut once: Vec<&str> = Vec::new();
    for word in words.into_iter().filter(|word| !word.is_empty()) {
        if !once.contains(&word) {
            once.push(word);
        }
    }
    once.join(", ")
}
