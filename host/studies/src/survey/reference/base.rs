//! A drive base that turns on the spot and drives a metre. The result is the largest difference between its heading and
//! the heading of its references.
//!
//! The drive base is the base in `tests/scenarios/drive-bases.toml`: two unequal NeveRest 60 under a robot of 6 kg, on
//! wheels of 90 mm that are 300 mm apart.

use super::{Figure, PERIODS, Row};
use crate::StudyError;
use crate::groups::HeadingError;
use crate::survey::parallel;
use motor_hub::motor::Setpoint;
use simulated::scenario::Scenario;
use simulated::without_tasks;

/// Name of each task, and the courses of the base in the form of a scenario file.
const TASKS: [(&str, &str); 2] = [
    (
        "drive base, turns of 90 degrees",
        "{ at_s = 0.5, turn_degrees = 90, speed_cps = 2258, acceleration_cps2 = 5051 },
         { at_s = 2.5, turn_degrees = -90, speed_cps = 2258, acceleration_cps2 = 5051 },
         { at_s = 4.5, turn_degrees = 90, speed_cps = 2258, acceleration_cps2 = 5051 },",
    ),
    (
        "drive base, a metre straight ahead",
        "{ at_s = 0.5, straight_mm = 1000, speed_cps = 2080, acceleration_cps2 = 4160 },",
    ),
];

/// Runs of all tasks: configured and not, at every period.
pub(super) const RUNS: usize = 2 * TASKS.len() * PERIODS.len();

fn scenario(courses: &str) -> Result<Scenario, StudyError> {
    let wheel = |label, motor| {
        format!(
            "[[motors]]\nlabel = \"{label}\"\nmotor = \"{motor}\"\nload = {{ inertia_kg_m2 = 0.006075 }}\n"
        )
    };
    let text = format!(
        "name = \"drive base\"\nduration_s = 6.5\nbattery = {{ emf_v = 12.0, resistance_ohm = 0.05 }}\n{}{}\
         [[groups]]\nlabel = \"base\"\nmotors = [\"left\", \"right\"]\n\
         base = {{ wheel_diameter_mm = 90, track_mm = 300 }}\ncourses = [{courses}]\n",
        wheel("left", "AM 60 A"),
        wheel("right", "AM 60 B"),
    );
    // A test shows that the text is valid, so this error does not occur.
    Scenario::parse("drive base", &text).map_err(|_| StudyError::NoEvent)
}

/// The rows of [`TASKS`]. `progress` gets the number of finished runs and the number of all runs.
pub(super) fn rows(progress: &mut dyn FnMut(usize, usize)) -> Result<Vec<Row>, StudyError> {
    let scenarios = TASKS.iter().map(|(_, courses)| scenario(courses)).collect::<Result<Vec<_>, _>>()?;
    let degrees = parallel::at_all_periods(&scenarios, &PERIODS, degrees, progress)?;
    let row = |((name, _), [configured_degrees, unknown_degrees]): ((&str, _), [Vec<f64>; 2])| Row {
        name: name.to_owned(),
        figure: Figure::Heading,
        configured_degrees,
        unknown_degrees,
        ..Row::default()
    };
    Ok(TASKS.into_iter().zip(degrees).map(row).collect())
}

/// The largest heading error of a run in degrees; infinite after a fault of a wheel's encoder.
fn degrees(scenario: &Scenario, configured: bool, period_ms: u32) -> Result<f64, StudyError> {
    let scenario = parallel::variant(scenario, configured, period_ms)?;
    let group = scenario.groups.first().ok_or(StudyError::NoEvent)?;
    let mut heading = HeadingError::new(group, &scenario.motors).ok_or(StudyError::NoEvent)?;
    let mut largest = 0.0;
    without_tasks::run(&scenario, |moment| {
        // Between two ticks the references do not change.
        if !moment.ms.is_multiple_of(period_ms.into()) {
            return;
        }
        let wheel = |motor: usize| -> Option<(Setpoint, i64)> {
            Some((moment.snapshot.motors.get(motor)?.setpoint, moment.view.motors.get(motor)?.1))
        };
        let error = heading.step(moment.ms as f64 / 1e3, wheel).unwrap_or(0.0);
        let at_fault =
            moment.snapshot.tick > 0 && moment.snapshot.motors.iter().any(|m| m.faults.encoder.is_some());
        largest = f64::max(largest, if at_fault { f64::INFINITY } else { error });
    })?;
    Ok(largest)
}
