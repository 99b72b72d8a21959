//! The flashed image on the emulated chip does what the same core does on the simulated board.

use emulated::{Board, replay};
use simulated::scenario::Scenario;
use simulated::sim;
use studies::overlay::Overlay;

/// One count in a control period of 50 ms.
const ONE_COUNT_CPS: f64 = 20.0;

/// On the board that `MOTOR_HUB_BOARD` names, or the first.
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
