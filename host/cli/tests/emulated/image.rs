//! The flashed image on the emulated chip does what the same core does on the simulated board, for scenarios and for
//! hosts. `MOTOR_HUB_BOARD` names the board that runs scenarios; the default is the first.

use crate::common::alone;
use crate::conformance::{Hub, conforms};
use crate::scenario_files;
use emulated::{Board, replay};
use simulated::scenario::Scenario;
use simulated::sim;
use studies::expectations::judge;
use studies::overlay::Overlay;

/// One count in a control period of 50 ms.
const ONE_COUNT_CPS: f64 = 20.0;

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_image_and_the_simulation_agree() {
    let scenario = replay::on_a_line(Scenario::default_one().expect("it is valid"));
    let board = Board::of_environment().expect("a board");
    let emulated = replay::run(&scenario, board, &mut |_| ()).expect("the image runs");
    let simulated = sim::run(&scenario, &mut |_| ()).expect("the simulation runs");
    let overlay = Overlay::new(scenario, board.chip(), emulated, simulated);
    for (motor, apart) in overlay.apart().into_iter().enumerate() {
        println!("motor {motor}: {apart:?}");
        assert!(apart.worst_cps <= ONE_COUNT_CPS, "motor {motor}: {apart:?}");
        assert!(apart.rms_cps <= 0.5 * ONE_COUNT_CPS, "motor {motor}: {apart:?}");
        assert!(apart.worst_counts <= 10, "motor {motor}: {apart:?}");
    }
}

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

/// The same host, and the same rules, as for the simulated hub.
#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_image_conforms_over_its_serial_line() {
    let _alone = alone();
    conforms(&mut Hub::start(&["--emulated", "--tcp", "127.0.0.1:0"]).tcp());
}
