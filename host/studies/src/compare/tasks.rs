//! The tasks: a NeveRest 60 with its measured rotor inertia turns a 10 kg flywheel of 10 cm radius. One task has no
//! flywheel, and one task has a flywheel of 40 kg.

use crate::{timed, velocity};
use motor_hub::model::battery::Battery;
use motor_hub::model::catalogue::{UnknownMotor, characterised};
use motor_hub::model::load::Load;
use motor_hub::model::si::{KgM2, Kilograms, Metres, Ohms, Volts};
use serde::Serialize;
use simulated::scenario::{Configuration, Motor, Scenario};

/// Free speed of the motor at 12 V, in counts/s.
const FREE_CPS: f64 = 2720.0;
/// Every task's length in seconds.
const LENGTH_S: f64 = 7.0;
/// Time of the event in most tasks, in seconds.
const EVENT_S: f64 = 3.0;

/// A task, and the time from which it is judged.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Task {
    /// Name of the task in files.
    pub(super) key: &'static str,
    /// What happens, in words.
    pub(super) what: String,
    /// Time of the event in seconds. Measures are taken from this time on.
    pub(super) event_s: f64,
    /// The scenario. Each variant replaces the scheme, the duty rule and the coefficients of the scenario.
    #[serde(skip)]
    pub(super) scenario: Scenario,
}

/// All tasks. Coefficients are chosen on the first task.
pub(super) fn all() -> Result<Vec<Task>, UnknownMotor> {
    let free = |share: f64| share * FREE_CPS;
    let step = || plan(&[(0.0, free(0.8)), (EVENT_S, free(0.3))], &[]);
    let mut tasks = Vec::new();
    let mut add = |key, what: &str, event_s, scenario: Scenario| {
        tasks.push(Task { key, what: what.to_owned(), event_s, scenario });
    };
    add("step", "80 to 30 % of the free speed", EVENT_S, step()?);
    let overhauling = plan(&[(0.0, free(0.5))], &[(EVENT_S, 0.8)])?;
    add(
        "overhauling",
        "Half of the free speed, then +0.8 N m in the direction of motion",
        EVENT_S,
        overhauling,
    );
    let reversal = plan(&[(0.0, free(0.6)), (EVENT_S, free(-0.6))], &[])?;
    add("reversal", "60 to -60 % of the free speed", EVENT_S, reversal);
    add("crawl", "From rest to 30 counts/s", 0.0, plan(&[(0.0, 30.0)], &[])?);
    add("hold", "Standstill, then +0.4 N m", EVENT_S, plan(&[(0.0, 0.0)], &[(EVENT_S, 0.4)])?);
    let mut sagging = plan(&[(0.0, free(0.25)), (EVENT_S, free(0.45))], &[])?;
    sagging.battery = Battery { emf: Volts(13.0), resistance: Ohms(0.6) };
    sagging.emf_over_time = timed([(1.0, 13.0), (6.0, 8.0)]);
    let sag = "25 to 45 % of the free speed, the battery (0.6 ohm) falling from 13 to 8 V";
    add("sag", sag, EVENT_S, sagging);
    for (key, what, inertia) in
        [("light", "The step without flywheel", 0.0), ("heavy", "The step with a flywheel of 40 kg", 0.2)]
    {
        let mut scenario = step()?;
        scenario.motors.iter_mut().for_each(|motor| motor.load = Load::inertia(KgM2(inertia)));
        add(key, what, EVENT_S, scenario);
    }
    for (key, what, resistance, emf) in [
        ("r-70", "The step, configured with 0.7 R", 0.7, 1.0),
        ("r-130", "The step, configured with 1.3 R", 1.3, 1.0),
        ("ke-90", "The step, configured with 0.9 Ke", 1.0, 0.9),
        ("ke-110", "The step, configured with 1.1 Ke", 1.0, 1.1),
    ] {
        let mut scenario = step()?;
        scenario.motors.iter_mut().for_each(|motor| {
            motor.configuration = Configuration { resistance, emf, ..Configuration::EXACT }
        });
        add(key, what, EVENT_S, scenario);
    }
    Ok(tasks)
}

/// Returns the scenario with these set-points in counts/s and torques in newton metres. Each is given with the time in
/// seconds at which it begins.
fn plan(speeds: &[(f64, f64)], torques: &[(f64, f64)]) -> Result<Scenario, UnknownMotor> {
    let speed = |&(at_s, cps): &(f64, f64)| (at_s, velocity(cps.round() as i32));
    let constants = characterised("NeveRest 60")?.with_measured_rotor_inertia();
    let mut motor = Motor::new(constants, Load::flywheel(Kilograms(10.0), Metres(0.1)));
    motor.setpoints = timed(speeds.iter().map(speed));
    motor.torques.extend(timed(torques.iter().copied()));
    Ok(Scenario::new("comparison", LENGTH_S, vec![motor]))
}
