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

use crate::common::{board, ms, on, other_board, publish};
use emulated::{Bench, Board};
use faults::Fault;
use modes::{MODES, Mode, Setup};
use rows::{CONFIGURED_AND_BRAKE, During, ExpectedEffect, ROWS, ROWS_OF_H743, Row};
use run::{MODE_CHANGE, OtherResult, RowResult, Run};

/// Number of chips, or chains of them, that run side by side.
const CHIPS: usize = 2;

/// Returns a text for each result that is not as expected.
fn complaints(row: &Row, seen: &RowResult) -> Vec<String> {
    let mut wrong = Vec::new();
    if seen.reports != row.reports {
        wrong.push(format!("{}: the hub reports {:?}", row.name, seen.reports));
    }
    if let Some(other) = seen.other.as_ref().filter(|other| disturbed(row, other)) {
        wrong.push(format!("{}: {other:?}", row.name));
    }
    for ((mode, seen), expected) in MODES.into_iter().zip(&seen.cells).zip(&row.cells) {
        let ExpectedEffect { during, reports, back } = expected;
        let turns =
            |speed, speeds: RangeInclusive<f64>| seen.longest_open <= MODE_CHANGE && speeds.contains(speed);
        let as_expected = match during {
            During::Works => turns(&seen.speed, mode.speeds()),
            During::Turns(least, most) => turns(&seen.speed, *least..=*most),
            During::TurnsOnAverage(least, most) => turns(&seen.mean_speed, *least..=*most),
            During::Opens { within_ms } => seen.open_after.is_some_and(|after| after <= ms(*within_ms)),
            During::Brakes { within_ms } => seen.shorted_after.is_some_and(|after| after <= ms(*within_ms)),
        };
        if !as_expected || seen.reports != *reports || seen.back != Ok(*back) {
            wrong.push(format!("{}, {}: {seen:?}", row.name, mode.name()));
        }
    }
    wrong
}

/// True if a hub has not done what a hub must do while the other hub of its chain has the fault of this row.
fn disturbed(row: &Row, other: &OtherResult) -> bool {
    let in_parent = other.fault_in_parent;
    // Requests to a child pass its parent. A parent that is reset loses these requests, and may answer late while it starts. After a
    // damaged byte a parent may wait for the rest of a packet, up to 50 ms.
    let must_answer =
        !in_parent || !(row.reports.contains(&"device reset") || matches!(row.fault, Fault::HostGarbled(_)));
    let answered = other.unanswered == 0 && other.slowest <= ms(2);
    // The child has a keep-alive of its own.
    let must_stop: &[Mode] =
        if in_parent && row.fault == Fault::HostGarbled(1_000_000) { &MODES } else { &[] };
    (must_answer && !answered) || other.disturbed != must_stop
}

/// Faults whose detection needs a part of the chip. The long tests have all faults.
#[test]
fn some_faults_end_as_they_should() {
    let rows = [
        "encoder unplugged",
        "A and B swapped",
        "bridge switched itself off",
        "host silent",
        "2 % of its words garbled",
        "nothing connected to the battery's pin",
    ];
    run_rows(Setup::AsTheyCome, on_one_hub(&rows.map(named)));
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn every_fault_in_every_mode_ends_as_it_should() {
    let table = run_rows(Setup::AsTheyCome, on_one_hub(&rows_of_board()));
    let head = "Default settings: only the winding is configured. A motor coasts after a fault.";
    publish("matrix-as-they-come", &format!("{head}\n\n{table}"));
}

/// Each row runs twice in a chain: once with its fault in the parent, once with its fault in the child. One half runs here, with the
/// board of the test as the parent, and the other half in the tests of the other board. Every other row has its fault in the
/// NUCLEO-F429ZI, and the rows between them have it in the NUCLEO-H743ZI2. The rows of motors that are configured do not run in a
/// chain, because the configuration of a motor changes nothing on the line.
#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn every_fault_of_one_hub_of_a_chain_ends_as_it_does_alone_and_leaves_the_other_hub_undisturbed() {
    let parent = board();
    let shares = [Board::NucleoF429zi, Board::NucleoH743zi2].map(|board| {
        let is_second = board == Board::NucleoH743zi2;
        let rows = on(board, rows_of_board).into_iter().enumerate();
        let rows =
            rows.filter(|(number, _)| (number % 2 == 1) == is_second || *number >= ROWS.len()).collect();
        Share { board, hubs: vec![parent, other_board()], rows }
    });
    let table = run_rows(Setup::AsTheyCome, shares);
    println!("The {parent} is the parent of the {}.\n\n{table}", other_board());
}

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn faults_of_motors_that_are_configured_and_brake_end_as_they_should() {
    let rows = CONFIGURED_AND_BRAKE.map(|(name, cells)| {
        let row = named(name);
        Row { cells: cells.unwrap_or(row.cells), ..*row }
    });
    let table = run_rows(Setup::ConfiguredBraking, on_one_hub(&rows.iter().collect::<Vec<_>>()));
    let head = "Motors whose dynamics are configured, and which are configured to brake at a fault.";
    publish("matrix-by-model-braking", &format!("{head}\n\n{table}"));
}

/// Returns the rows that only the board of the test has, or that have other results on it.
fn of_board() -> &'static [Row] {
    if board() == Board::NucleoH743zi2 { &ROWS_OF_H743 } else { &[] }
}

/// Returns all rows that the board of the test has.
fn rows_of_board() -> Vec<&'static Row> {
    let alone = of_board().iter().filter(|row| !ROWS.iter().any(|other| other.name == row.name));
    ROWS.iter().map(|row| named(row.name)).chain(alone).collect()
}

/// Returns the row with this name, with the results that the board of the test should have.
fn named(name: &str) -> &'static Row {
    let mut rows = of_board().iter().chain(&ROWS);
    rows.find(|row| row.name == name).unwrap_or_else(|| panic!("no row {name}"))
}

/// The rows that run one after another on the same chips. The same rows always share their chips, so each run gives the same
/// results.
struct Share<'a> {
    /// The board that has the faults.
    board: Board,
    /// The boards of all hubs, the parent first.
    hubs: Vec<Board>,
    /// The rows, with their numbers in the table.
    rows: Vec<(usize, &'a Row)>,
}

/// Shares rows between hubs of the board of the test, each without a chain.
fn on_one_hub<'a>(rows: &[&'a Row]) -> [Share<'a>; CHIPS] {
    [0, 1].map(|first| {
        let rows = rows.iter().copied().enumerate().skip(first).step_by(CHIPS).collect();
        Share { board: board(), hubs: vec![board()], rows }
    })
}

/// Runs rows, the shares side by side, and returns their table.
fn run_rows<'a>(setup: Setup, shares: [Share<'a>; CHIPS]) -> String {
    let work = |share: Share<'a>| {
        let (mut seen, mut wrong) = (Vec::new(), Vec::new());
        let mut run = Run::new(setup, &share.hubs);
        let mut lost_counts = false;
        for (number, row) in share.rows {
            if lost_counts && !row.loses_counts() {
                run.chain.hubs.iter_mut().for_each(Bench::assert_sound);
                run = Run::new(setup, &share.hubs);
            }
            lost_counts = row.loses_counts();
            let came = run.row(row);
            let complaints = complaints(row, &came);
            seen.push((number, row, came));
            if !complaints.is_empty() {
                run = Run::new(setup, &share.hubs);
                wrong.extend(complaints);
            }
        }
        run.chain.hubs.iter_mut().for_each(Bench::assert_sound);
        (seen, wrong)
    };
    let (mut seen, mut wrong) = (Vec::new(), Vec::new());
    std::thread::scope(|scope| {
        let work = &work;
        for share in shares.map(|share| scope.spawn(move || on(share.board, || work(share)))) {
            let came = share.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
            seen.extend(came.0);
            wrong.extend(came.1);
        }
    });
    seen.sort_by_key(|(number, ..)| *number);
    let table = table::text(seen.iter().map(|(_, row, seen)| (*row, seen)));
    assert!(wrong.is_empty(), "{table}\n{}", wrong.join("\n"));
    table
}
