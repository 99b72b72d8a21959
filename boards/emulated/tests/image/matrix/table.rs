//! Writes the table of the fault matrix for `docs/results`.

use std::fmt::Write;

use super::modes::MODES;
use super::rows::{Back, Row};
use super::run::{MotorResult, RowResult};

/// Rows of Markdown.
pub(crate) fn text<'a>(rows: impl Iterator<Item = (&'a Row, &'a RowResult)>) -> String {
    let names = MODES.map(|mode| mode.name());
    let mut out = format!("| | {} | reported | back |\n|{}\n", names.join(" | "), "---|".repeat(7));
    for (row, seen) in rows {
        let cells: Vec<String> = seen.cells.iter().map(cell).collect();
        let mut says = seen.says.clone();
        let mut back: Vec<&str> = Vec::new();
        for cell in &seen.cells {
            says.extend(&cell.says);
            back.push(cell.back.map_or("not", Back::name));
        }
        // Writing to a string does not fail.
        let _ = writeln!(out, "| {} | {} | {} | {} |", row.name, cells.join(" | "), once(says), once(back));
    }
    out
}

fn cell(seen: &MotorResult) -> String {
    // The sum with 0 makes a positive zero of a negative one.
    let speed = format!("{:.0} counts/s", seen.speed.round() + 0.0);
    match (seen.open_after, seen.shorted_after) {
        (Some(after), _) => format!("open after {:.0} ms", after.as_secs_f64() * 1e3),
        (_, Some(after)) => format!("shorted after {:.0} ms, {speed}", after.as_secs_f64() * 1e3),
        (None, None) => speed,
    }
}

/// Words without repetition and without empty ones.
fn once(words: Vec<&str>) -> String {
    let mut once: Vec<&str> = Vec::new();
    for word in words.into_iter().filter(|word| !word.is_empty()) {
        if !once.contains(&word) {
            once.push(word);
        }
    }
    once.join(", ")
}
