//! Every motor of the catalogue without a load, at a speed and to a position, with default settings.

use super::responses::{self, Verdict};
use super::{Knowledge, free_cps, parallel, time_constant};
use crate::{StudyError, position, timed, velocity};
use motor_hub::model::catalogue;
use motor_hub::model::load::Load;
use motor_hub::units::CountsPerSecond;
use serde::Serialize;
use simulated::scenario::{Motor, Scenario};

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

/// Runs all bare motors. `progress` gets the number of finished motors and the number of all motors, in each mode.
pub fn run(progress: &mut dyn FnMut(usize, usize)) -> Result<Vec<BareMotor>, StudyError> {
    let measured = |motor: catalogue::Motor| motor.with_measured_rotor_inertia();
    // With their measured inertia the Core Hex motors take half a minute to start.
    let slow = |motor: &catalogue::Motor| time_constant(&measured(*motor), &Load::NONE) > SLOW;
    let motors = catalogue::motors().map(measured).chain(catalogue::motors().filter(slow));
    let cases: Vec<_> = motors.flat_map(|motor| ["velocity", "position"].map(|mode| (motor, mode))).collect();
    parallel::map(&cases, |&(motor, mode)| bare_motor(motor, mode), progress)
}

fn bare_motor(motor: catalogue::Motor, mode: &'static str) -> Result<BareMotor, StudyError> {
    let scenario = scenario(motor, mode == "velocity");
    let both = |knowledge: Knowledge, period_ms| -> Result<[Verdict; 2], StudyError> {
        let verdicts = responses::verdicts(&knowledge.at_period(&scenario, period_ms)?)?;
        verdicts.try_into().map_err(|_| StudyError::NoEvent)
    };
    let at_all_periods =
        |knowledge| PERIODS.into_iter().map(|ms| both(knowledge, ms)).collect::<Result<_, _>>();
    Ok(BareMotor {
        motor: motor.name,
        paper_inertia: motor.j != motor.j_rotor_measured,
        mode,
        configured: at_all_periods(Knowledge::EXACT)?,
        unknown: at_all_periods(Knowledge::UNKNOWN)?,
    })
}

/// The scenario of one motor. By speed, the motor turns at half of its free speed, and then at a tenth of its free
/// speed. By position, it moves by the distance that half of the free speed covers in a second, and back.
fn scenario(constants: catalogue::Motor, by_speed: bool) -> Scenario {
    let free = free_cps(&constants, VOLTS);
    let value = |share: f64| {
        if by_speed {
            velocity((share * free) as i32)
        } else {
            position(if share > 0.2 { (share * free) as i32 } else { 0 }, CountsPerSecond::MAX)
        }
    };
    let length = ((LENGTH_S + 2.0 * time_constant(&constants, &Load::NONE)) * 10.0).round() / 10.0;
    let setpoints = timed([(0.0, value(0.5)), (length, value(0.1))]);
    let motor = Motor { setpoints, ..Motor::new(constants, Load::NONE) };
    Scenario::new("cell", 2.0 * length, vec![motor])
}
