//! Runs the scenarios in `tests/scenarios` with `emulated = true` by the flashed image on the emulated chip, and checks
//! their expectations. `MOTOR_HUB_BOARD` names the board; the default is the first.

use crate::scenario_files;
use emulated::{Board, replay};
use studies::expectations::judge;

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn every_scenario_for_the_chip_is_as_it_expects() {
    let board = Board::of_environment().expect("a board");
    let mut unmet = Vec::new();
    let mut run = 0;
    for (file, scenario) in scenario_files::all().into_iter().filter(|(_, scenario)| scenario.emulated) {
        let scenario = replay::on_a_line(scenario);
        let trace =
            replay::run(&scenario, board, &mut |_| ()).unwrap_or_else(|error| panic!("{file}: {error}"));
        unmet.extend(scenario_files::unmet(&file, &judge(&scenario, &trace)));
        run += 1;
    }
    assert!(unmet.is_empty(), "not as expected:\n{}", unmet.join("\n"));
    assert!(run > 0, "no scenario is for the chip");
}
