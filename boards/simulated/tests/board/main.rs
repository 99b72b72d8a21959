//! Tests of the simulated board.

use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use simulated::scenario::{Motor, Scenario};
use simulated::sim;
use simulated::trace::Trace;
use simulated::world::Board;
use std::sync::{Mutex, PoisonError};

mod bus;
mod chain;
mod coefficients;
mod files;
mod heading;
mod host;
mod interventions;
mod lines;
mod memory;
mod scenarios;
mod wires;
mod world;

/// A scenario of a NeveRest 60 without load on each of these bridges.
fn scenario(bridges: &[BridgeConstants]) -> Scenario {
    let motor = characterised("NeveRest 60").expect("known").with_measured_rotor_inertia();
    let motors = bridges.iter().map(|&bridge| Motor { bridge, ..Motor::new(motor, Load::NONE) });
    Scenario::new("board", 1.0, motors.collect())
}

fn board(bridges: &[BridgeConstants]) -> Board {
    Board::new(&scenario(bridges))
}

/// All runs of the process share the clock of the mock driver, so they wait for each other.
static CLOCK: Mutex<()> = Mutex::new(());

fn run_tasks(scenario: &Scenario) -> Trace {
    let _clock = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
    sim::run(scenario, &mut |_| ()).expect("it runs")
}
