//! Every motor of the catalogue without a load, at a speed and to a position, with default settings.

use super::responses::{Verdict, judge, watch};
use super::time_constant;
use super::{Knowledge, parallel};
use crate::settling::changes;
use crate::{StudyError, position, velocity};
use motor_hub::model::catalogue;
use motor_hub::model::load::Load;
use motor_hub::units::CountsPerSecond;
use serde::Serialize;
use simulated::scenario::{Motor, Scenario, Timed};

/// Control periods in milliseconds.
pub const PERIODS: [u32; 4] = [1, 10, 50, 100];

/// Voltage of the battery without load, in volts.
const VOLTS: f64 = 12.0;
/// A motor with a longer time constant, in seconds, also runs with the paper's inertia.
const SLOW: f64 = 3.0;
/// Seconds that each response has, besides two mechanical time constants.
const LENGTH_S: f64 = 3.0;

/// A motor in a mode, at all [`PERIODS`].
#[derive(Clone, Debug, Serialize)]
pub struct BareMotor {
    /// The motor's name.
    pub motor: &'static str,
    /// True if the inertia is the paper's, false if it is the measured one.
    pub paper_inertia: bool,
    /// "velocity" or "position".
    pub mode: &'static str,
    /// Verdicts with the motor configured exactly: two responses for each period.
    pub configured: Vec<[Verdict; 2]>,
    /// Verdicts with the motor not configured: two responses for each period.
    pub unknown: Vec<[Verdict; 2]>,
}

/// Runs all bare motors. `progress` gets the number of finished runs and the number of all runs.
///
/// # Errors
/// If a run fails.
pub fn run(progress: &mut dyn FnMut(usize, usize)) -> Result<Vec<BareMotor>, StudyError> {
    let mut motors: Vec<catalogue::Motor> =
        catalogue::motors().map(|motor| motor.with_measured_rotor_inertia()).collect();
    // With their measured inertia the Core Hex motors take half a minute to start.
    let slow =
        |motor: &catalogue::Motor| time_constant(&motor.with_measured_rotor_inertia(), &Load::NONE) > SLOW;
    motors.extend(catalogue::motors().filter(slow));
    let modes = ["velocity", "position"];
    let cases: Vec<(catalogue::Motor, &'static str)> =
        motors.into_iter().flat_map(|motor| modes.map(|mode| (motor, mode))).collect();
    let verdicts = parallel::at_all_periods(
        &cases,
        &PERIODS,
        |&(motor, mode), knowledge, ms| both(&scenario(motor, mode == "velocity"), knowledge, ms),
        progress,
    )?;
    let bare_motors = cases.iter().zip(verdicts).map(|((motor, mode), [configured, unknown])| BareMotor {
        motor: motor.name,
        paper_inertia: motor.j != motor.j_rotor_measured,
        mode,
        configured,
        unknown,
    });
    Ok(bare_motors.collect())
}

/// The scenario of one motor. By speed, the motor turns at half of its free speed, and then at a tenth of its free
/// speed. By position, it moves by the distance that half of the free speed covers in a second, and back.
fn scenario(constants: catalogue::Motor, by_speed: bool) -> Scenario {
    let electrical = constants.ke.0 * constants.kt.0 / constants.r.0;
    let time_constant = time_constant(&constants, &Load::NONE);
    let counts = constants.counts_per_rev_motor / core::f64::consts::TAU;
    let free = counts * constants.kt.0 / constants.r.0 * VOLTS / (electrical + constants.b.0);
    let value = |share: f64| {
        if by_speed {
            velocity((share * free) as i32)
        } else {
            position(if share > 0.2 { (share * free) as i32 } else { 0 }, CountsPerSecond::MAX)
        }
    };
    let length = ((LENGTH_S + 2.0 * time_constant) * 10.0).round() / 10.0;
    let setpoints = vec![Timed { at_s: 0.0, value: value(0.5) }, Timed { at_s: length, value: value(0.1) }];
    let motor = Motor { setpoints, ..Motor::new(constants, Load::NONE) };
    Scenario::new("cell", 2.0 * length, vec![motor])
}

fn both(scenario: &Scenario, knowledge: Knowledge, period_ms: u32) -> Result<[Verdict; 2], StudyError> {
    let scenario = parallel::variant(scenario, knowledge, period_ms)?;
    let motor = scenario.motors.first().ok_or(StudyError::NoEvent)?;
    match (changes(motor, scenario.duration_s).as_slice(), watch(&scenario)?.first()) {
        ([first, second], Some(track)) => Ok([judge(first, track), judge(second, track)]),
        _ => Err(StudyError::NoEvent),
    }
}
