//! The scenarios of a sweep: every motor of the catalogue with every setting. Every encoder is sound, so every fault is
//! a false alarm.

use super::bare_motors::PERIODS;
use super::soak::Case;
use super::{Knowledge, free_cps};
use crate::{position, timed, velocity};
use motor_hub::braking::{DutyRule, Scheme};
use motor_hub::model::battery::Battery;
use motor_hub::model::catalogue;
use motor_hub::model::load::Load;
use motor_hub::model::si::{KgM2, Ohms, Volts};
use motor_hub::motor::Setpoint;
use motor_hub::units::{CountsPerSecond, Period};
use simulated::hardware::{MOTORS, REAL_BRIDGE};
use simulated::scenario::{Motor, Scenario};

/// Voltages of the battery without load, in volts.
const VOLTS: [f64; 3] = [6.5, 12.0, 14.5];
/// Dry frictions in percent of the stall torque at 12 V.
const FRICTION_PERCENT: [f64; 3] = [0.0, 20.0, 40.0];
/// How the motors are configured.
const KNOWLEDGE: [Knowledge; 2] = [Knowledge::EXACT, Knowledge::UNKNOWN];
/// Length of a scenario of the sweep, in seconds.
const DURATION_S: f64 = 6.0;

/// Every `every`th of the scenarios, with four motors each, and how they are configured. Every motor has no load and
/// both of its inertias, under every scheme and duty rule. Friction is up to 40 % of the stall torque. The battery has
/// 6.5 to 14.5 V. The control period is 1 to 100 ms. The motion is configured exactly, or not at all.
pub fn scenarios(every: usize) -> Vec<Case> {
    let mut all = Vec::new();
    for (period_ms, volts) in PERIODS.into_iter().flat_map(|period_ms| VOLTS.map(|volts| (period_ms, volts)))
    {
        for knowledge in KNOWLEDGE {
            for motors in motors(volts).chunks(MOTORS) {
                let mut scenario = Scenario::new("sweep", DURATION_S, motors.to_vec());
                scenario.period = Period::from_millis(period_ms).unwrap_or_default();
                scenario.battery = Battery { emf: Volts(volts), resistance: Ohms(0.0) };
                scenario.unlimited = true;
                knowledge.configure(&mut scenario.motors);
                if all.len() % 2 == 1 {
                    scenario.motors.iter_mut().for_each(|motor| motor.bridge = REAL_BRIDGE);
                }
                all.push((scenario, knowledge));
            }
        }
    }
    all.into_iter().step_by(every.max(1)).collect()
}

/// Inertias of motor and load together in the long sweep, as multiples of the rotor's inertia.
const INERTIAS: [f64; 7] = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1_000.0];
/// How the motors of the long sweep are configured.
const KNOWLEDGE_LONG: [Knowledge; 4] = [
    Knowledge::EXACT,
    Knowledge::inertia("half-inertia", "inertia x0.5", 0.5),
    Knowledge::inertia("double-inertia", "inertia x2", 2.0),
    Knowledge::UNKNOWN,
];
/// Length of a scenario of the long sweep, in seconds.
const LONG_S: f64 = 120.0;

/// Every `every`th of the long scenarios, with one motor each, and how the motor is configured. A motor has 1 to 1000
/// times its rotor's inertia and no friction. A motor with a heavy load needs minutes for a motion that a bare motor
/// ends in 0.1 s.
pub fn long_scenarios(every: usize) -> Vec<Case> {
    let mut all = Vec::new();
    for constants in catalogue::motors().map(|motor| motor.with_measured_rotor_inertia()) {
        for (multiple, knowledge) in
            INERTIAS.into_iter().flat_map(|multiple| KNOWLEDGE_LONG.map(|knowledge| (multiple, knowledge)))
        {
            for (positions, period_ms) in [false, true].into_iter().flat_map(|p| PERIODS.map(|ms| (p, ms))) {
                let reflected = constants.eta * constants.gear_ratio * constants.gear_ratio;
                let load = Load::inertia(KgM2((multiple - 1.0) * constants.j.0 * reflected));
                let setpoints = timed(long_course(free_cps(&constants, 12.0), positions));
                let mut motors = vec![Motor { setpoints, ..Motor::new(constants, load) }];
                knowledge.configure(&mut motors);
                // Some motors accelerate more slowly than the hub's settings can represent.
                if motors.iter().any(|motor| motor.settings().is_err()) {
                    continue;
                }
                let period = Period::from_millis(period_ms).unwrap_or_default();
                all.push((Scenario { period, ..Scenario::new("long sweep", LONG_S, motors) }, knowledge));
            }
        }
    }
    all.into_iter().step_by(every.max(1)).collect()
}

/// Set-points: 0.7, 0.15, -0.5 and 0.3 of the free speed, then standstill; or to a position and back beyond the start.
/// `free` is in counts/s.
fn long_course(free: f64, positions: bool) -> Vec<(f64, Setpoint)> {
    let velocity = |share: f64| velocity((share * free) as i32);
    let limit = CountsPerSecond::new((0.5 * free) as i32);
    let position = |turns: f64| position((turns * free) as i32, limit);
    if positions {
        vec![(0.1, position(5.0)), (60.0, position(-2.0))]
    } else {
        vec![
            (0.1, velocity(0.7)),
            (40.0, velocity(0.15)),
            (55.0, velocity(-0.5)),
            (90.0, velocity(0.3)),
            (110.0, velocity(0.0)),
        ]
    }
}

/// Every motor with every inertia, scheme, duty rule and friction, for a battery of this voltage.
fn motors(volts: f64) -> Vec<Motor> {
    let mut all = Vec::new();
    for constants in catalogue::motors().flat_map(|motor| [motor, motor.with_measured_rotor_inertia()]) {
        for (scheme, duty) in
            Scheme::ALL.into_iter().flat_map(|scheme| DutyRule::ALL.map(|duty| (scheme, duty)))
        {
            for percent in FRICTION_PERCENT {
                let setpoints = timed(course(1e3 * volts / constants.ke_fw()));
                let label = format!("{} {}", constants.name, all.len());
                let mut motor = Motor { label, scheme, duty, setpoints, ..Motor::new(constants, Load::NONE) };
                motor.set_friction(percent);
                all.push(motor);
            }
        }
    }
    all
}

/// Set-points: 0.5 and -0.3 of the free speed, 60 counts/s, standstill, a position, and -0.1 of the free speed. `free`
/// is in counts/s.
fn course(free: f64) -> [(f64, Setpoint); 6] {
    let velocity = |speed: f64| velocity(speed as i32);
    let limit = CountsPerSecond::new(free as i32);
    let position = |turns: f64| position((turns * free) as i32, limit);
    [
        (0.1, velocity(0.5 * free)),
        (1.2, velocity(-0.3 * free)),
        (2.2, velocity(60.0)),
        (3.2, velocity(0.0)),
        (3.7, position(-0.3)),
        (5.0, velocity(-0.1 * free)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_name_of_a_configuration_in_the_long_sweep_has_its_factor_of_the_inertia() {
        for (scenario, knowledge) in long_scenarios(1) {
            let named = knowledge.name.strip_prefix("inertia x").unwrap_or("1");
            let inertia = scenario.motors[0].configuration.inertia;
            assert_eq!(named.parse(), Ok(inertia), "{knowledge:?}");
        }
    }
}
