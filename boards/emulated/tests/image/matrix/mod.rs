//! The fault matrix: every fault in every mode of a motor. A test notes what the bridge does, how long it takes until the motor is
//! not driven any more, what the hub reports, and how the motor runs again. The tables are in `docs/results`.
//!
//! Four motors run in four modes, so one part of a run gives one row. Rows use the same chip as long as all results are as
//! expected.

mod faults;
mod modes;
mod rows;
mod run;
mod table;

use std::ops::RangeInclusive;
use std::sync::Mutex;

use crate::common::{board, ms, on, publish};
use emulated::Board;
use modes::{MODES, Setup};
use rows::{CONFIGURED_AND_BRAKE, Cell, During, ROWS, ROWS_OF_H743, Row};
use run::{RowResult, Run};

/// Number of chips that run side by side.
const CHIPS: usize = 2;

/// Returns a text for each result that is not as expected.
fn complaints(row: &Row, seen: &RowResult) -> Vec<String> {
    let mut wrong = Vec::new();
    if seen.says != row.says {
        wrong.push(format!("{}: the hub says {:?}", row.name, seen.says));
    }
    for ((mode, seen), expected) in MODES.into_iter().zip(&seen.cells).zip(&row.cells) {
        let Cell { during, says, back } = expected;
        // A bridge is open for 1 ms when its mode changes.
        let turns = |speeds: RangeInclusive<f64>| seen.longest_open <= ms(2) && speeds.contains(&seen.speed);
        let as_expected = match during {
            During::Works => turns(mode.speeds()),
            During::Turns(least, most) => turns(*least..=*most),
            During::Opens { within_ms } => seen.open_after.is_some_and(|after| after <= ms(*within_ms)),
            During::Brakes { within_ms } => seen.shorted_after.is_some_and(|after| after <= ms(*within_ms)),
        };
        if !as_expected || seen.says != *says || seen.back != Ok(*back) {
            wrong.push(format!("{}, {}: {seen:?}", row.name, mode.name()));
        }
    }
    wrong
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn every_fault_in_every_mode_ends_as_it_should() {
    let alone = of_board().iter().filter(|row| !ROWS.iter().any(|other| other.name == row.name));
    let rows: Vec<&Row> = ROWS.iter().map(|row| named(row.name)).chain(alone).collect();
    let table = run_rows(Setup::AsTheyCome, &rows);
    let head = "Motors as they come: only the winding is configured. A fault lets a motor coast.";
    publish("matrix-as-they-come", &format!("{head}\n\n{table}"));
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn faults_of_motors_that_are_configured_and_brake_end_as_they_should() {
    let table = run_rows(Setup::ConfiguredBraking, &CONFIGURED_AND_BRAKE.iter().collect::<Vec<_>>());
    let head = "Motors whose dynamics are configured, and which are configured to brake at a fault.";
    publish("matrix-by-model-braking", &format!("{head}\n\n{table}"));
}

/// Returns the rows that only the board of the test has, or that have other results on it.
fn of_board() -> &'static [Row] {
    if board() == Board::NucleoH743zi2 { &ROWS_OF_H743 } else { &[] }
}

/// Returns the row with this name, with the results that the board of the test should have.
fn named(name: &str) -> &'static Row {
    let mut rows = of_board().iter().chain(&ROWS);
    rows.find(|row| row.name == name).unwrap_or_else(|| panic!("no row {name}"))
}

/// Runs the rows with these names, and expects their results.
pub(crate) fn rows_end_as_they_should(names: &[&str]) {
    run_rows(Setup::AsTheyCome, &names.iter().map(|name| named(name)).collect::<Vec<_>>());
}

/// Runs rows and returns their table.
fn run_rows(setup: Setup, rows: &[&Row]) -> String {
    let (seen, wrong) = (Mutex::new(Vec::new()), Mutex::new(Vec::new()));
    // The same rows always share a chip, so each run gives the same results.
    let board = board();
    let work = |first: usize| {
        let mut run = Run::new(setup);
        for (place, row) in rows.iter().enumerate().skip(first).step_by(CHIPS) {
            let came = run.row(row);
            let complaints = complaints(row, &came);
            seen.lock().expect("no panic").push((place, came));
            if !complaints.is_empty() {
                run = Run::new(setup);
                wrong.lock().expect("no panic").extend(complaints);
            }
        }
        run.bench.assert_sound();
    };
    std::thread::scope(|scope| {
        let chips: Vec<_> = (0..CHIPS)
            .map(|first| {
                let work = &work;
                scope.spawn(move || on(board, || work(first)))
            })
            .collect();
        chips.into_iter().for_each(|chip| {
            chip.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        });
    });
    let mut seen = seen.into_inner().expect("no panic");
    seen.sort_by_key(|(place, _)| *place);
    let table = table::text(rows.iter().copied().zip(seen.iter().map(|(_, seen)| seen)));
    let wrong = wrong.into_inner().expect("no panic");
    assert!(wrong.is_empty(), "{table}\n{}", wrong.join("\n"));
    table
}
