//! Reference tasks at several control periods. The reference figures are from a simulation that was made before the
//! regulator was written. Tasks of a drive base have no reference figures: the result is the largest difference between
//! the heading of the base and the heading of its references.

use super::responses::{Verdict, judge, watch};
use super::{Knowledge, parallel};
use crate::StudyError;
use crate::groups::HeadingError;
use crate::settling::changes;
use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use motor_hub::model::si::{Drag, KgM2, Volts};
use motor_hub::motor::Setpoint;
use motor_hub::units::CountsPerSecond;
use serde::Serialize;
use simulated::scenario::{Motor, Scenario, Timed};
use simulated::without_tasks;

/// Control periods in milliseconds.
pub const PERIODS: [u32; 6] = [1, 5, 10, 20, 50, 100];

/// Delay of a change after a tick, in seconds, so that the hub acts on the change at the next tick. The delay is the
/// sampling interval of the encoder.
const LATE_S: f64 = 1e-3;

/// The kind of figure by which a response is compared with the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Figure {
    /// Settling time, and the largest error beyond the set-point.
    #[default]
    Settling,
    /// Mean error at the end, in counts.
    Offset,
    /// Root mean square of the error in the last second, in percent of the speed.
    Rms,
    /// Largest heading error of a drive base, in degrees.
    Heading,
}

/// A task.
#[derive(Clone, Debug)]
struct Task {
    /// The row of the task, without verdicts.
    row: Row,
    /// One scenario for each motor.
    scenarios: Vec<Scenario>,
    /// Index of the response in the scenario.
    response: usize,
}

/// The verdicts of a task.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Row {
    /// The task's name.
    pub name: String,
    /// The figure that the reference reached with a period of 50 ms; of several motors the worst.
    pub reference: &'static str,
    /// The kind of figure.
    pub figure: Figure,
    /// Verdicts with the motor configured exactly, in the order of [`PERIODS`].
    pub configured: Vec<Verdict>,
    /// Verdicts with the motor not configured, in the order of [`PERIODS`].
    pub unknown: Vec<Verdict>,
    /// As `configured`, but the change comes 1 ms after a tick, so that the hub acts almost a period later. Empty
    /// unless the figure is a settling time.
    pub configured_late: Vec<Verdict>,
    /// As `unknown`, but the change comes 1 ms after a tick. Empty unless the figure is a settling time.
    pub unknown_late: Vec<Verdict>,
    /// Heading errors of a drive base, configured exactly; in the order of [`PERIODS`]. Empty for a motor alone.
    pub configured_degrees: Vec<f64>,
    /// Heading errors of a drive base, not configured; in the order of [`PERIODS`]. Empty for a motor alone.
    pub unknown_degrees: Vec<f64>,
    /// Speed set-point in counts/s; 0 for a position.
    pub speed: f64,
}

/// The motors of the tasks with slow speeds.
const CRAWLERS: [&str; 3] = ["AM 60 A", "AM 3.7 A", "Matrix A"];

/// All tasks.
fn tasks() -> Result<Vec<Task>, StudyError> {
    let flywheel = |speeds: &[(f64, i32)]| plan("AM 20 A", 0.006, &velocities(speeds));
    let winch = |speeds: &[(f64, i32)]| plan("AM 60 A", 0.05, &velocities(speeds));
    let mut all = Vec::new();
    let mut task = |name: &str, reference, figure, response, scenarios: Vec<Scenario>| {
        let motor = scenarios.first().and_then(|scenario| scenario.motors.first());
        let speed = match motor.and_then(|motor| motor.setpoints.last()).map(|timed| timed.value) {
            Some(Setpoint::Velocity(cps)) => cps.to_f64(),
            _ => 0.0,
        };
        let row = Row { name: name.to_owned(), reference, figure, speed, ..Row::default() };
        all.push(Task { row, scenarios, response });
    };
    use Figure::{Offset, Rms, Settling};
    let up_and_down = flywheel(&[(0.5, 2330), (5.0, 875)])?;
    task("flywheel 0 -> 2330", "0.35/0.4", Settling, 0, vec![up_and_down.clone()]);
    task("flywheel 80 -> 30 %", "0.19/0.5", Settling, 1, vec![up_and_down]);
    let pushed = with_torque(winch(&[(0.5, 1360)])?, 4.0, 0.8);
    task("winch 0 -> 1360", "0.27/0.4", Settling, 0, vec![pushed.clone()]);
    task("winch +0.8 N m", "0.23/10.2", Settling, 1, vec![pushed]);
    task("winch 2176 -> 816", "0.20/0.4", Settling, 1, vec![winch(&[(0.5, 2176), (4.0, 816)])?]);
    task("winch 1632 -> -1632", "0.44/0.1", Settling, 1, vec![winch(&[(0.5, 1632), (4.0, -1632)])?]);
    let arm = arm()?;
    task("arm 0 -> 4000", "2.48/0.1", Settling, 0, vec![arm.clone()]);
    task("arm 4000 -> 500", "2.18/0", Settling, 1, vec![arm.clone()]);
    task("arm 4000 -> 500, last error", "<= 1 count", Offset, 1, vec![arm]);
    task("0.5 kg m2 0 -> 5000", "4.08/0", Settling, 0, vec![plan("AM 60 A", 0.5, &[position(0.5, 5000)])?]);
    task(
        "Matrix 12 V bare 0 -> 3000",
        "1.36/0.1",
        Settling,
        0,
        vec![plan("Matrix A", 0.0, &[position(0.5, 3000)])?],
    );
    task(
        "winch 0, +0.4 N m: offset",
        "14 counts",
        Offset,
        1,
        vec![with_torque(plan("AM 60 A", 0.05, &[position(0.5, 0)])?, 4.0, 0.4)],
    );
    let speeds = [5, 10, 20, 50];
    for (friction, name, references) in [
        (0.0, "", ["0.9 %", "0.5 %", "0.9 %", "1.2 %"]),
        (5.0, ", 5 % friction", ["0.8 %", "0.6 %", "0.9 %", "1.0 %"]),
    ] {
        for (cps, reference) in speeds.into_iter().zip(references) {
            let mut scenarios = Vec::new();
            for motor in CRAWLERS {
                let mut scenario = plan(motor, 0.0, &velocities(&[(0.0, cps)]))?;
                scenario.motors.iter_mut().for_each(|motor| motor.set_friction(friction));
                scenarios.push(scenario);
            }
            task(&format!("{cps} counts/s{name}, rms"), reference, Rms, 0, scenarios);
        }
    }
    Ok(all)
}

fn velocities(speeds: &[(f64, i32)]) -> Vec<Timed<Setpoint>> {
    speeds.iter().map(|&(at_s, cps)| Timed { at_s, value: crate::velocity(cps) }).collect()
}

fn position(at_s: f64, target: i32) -> Timed<Setpoint> {
    Timed { at_s, value: crate::position(target, CountsPerSecond::MAX) }
}

/// A motor alone, with an inertia in kg m² on its output shaft.
fn plan(motor: &str, inertia: f64, setpoints: &[Timed<Setpoint>]) -> Result<Scenario, StudyError> {
    let constants = characterised(motor)?.with_measured_rotor_inertia();
    let motor =
        Motor { setpoints: setpoints.to_vec(), ..Motor::new(constants, Load::inertia(KgM2(inertia))) };
    let mut scenario = Scenario::new("reference", 10.0, vec![motor]);
    scenario.battery.emf = Volts(12.6);
    Ok(scenario)
}

fn with_torque(mut scenario: Scenario, at_s: f64, value: f64) -> Scenario {
    for motor in &mut scenario.motors {
        motor.torques.push(Timed { at_s, value });
    }
    scenario
}

/// The arm of the default scenario, but with the tolerance of the other tasks.
fn arm() -> Result<Scenario, StudyError> {
    let there = |at_s, target| Timed { at_s, value: crate::position(target, CountsPerSecond::new(1800)) };
    let mut scenario = plan("AM 40 C", 0.02, &[there(0.0, 4000), there(5.0, 500)])?;
    for motor in &mut scenario.motors {
        motor.scheme = Scheme::B;
        motor.load.drag_after = Drag(0.005);
        motor.torques = vec![Timed { at_s: 0.0, value: -0.3 }];
    }
    Ok(scenario)
}

/// Runs all tasks at all [`PERIODS`], configured exactly and not configured. `progress` gets the number of finished
/// runs and the number of all runs.
///
/// # Errors
/// If a run fails.
pub fn run(progress: &mut dyn FnMut(usize, usize)) -> Result<Vec<Row>, StudyError> {
    let tasks = tasks()?;
    let runs = |tasks: usize| 2 * tasks * PERIODS.len();
    let responses = runs(tasks.len());
    let total = responses + runs(BASE_TASKS.len());
    let work = |task: &Task, knowledge, ms| {
        let late =
            (task.row.figure == Figure::Settling).then(|| worst(task, true, knowledge, ms)).transpose()?;
        Ok((worst(task, false, knowledge, ms)?, late))
    };
    let verdicts = parallel::at_all_periods(&tasks, &PERIODS, work, &mut |done, _| progress(done, total))?;
    let mut rows = Vec::new();
    for (task, verdicts) in tasks.into_iter().zip(verdicts) {
        let [(configured, configured_late), (unknown, unknown_late)] =
            verdicts.map(|both| both.into_iter().unzip::<_, _, Vec<_>, Vec<_>>());
        rows.push(Row {
            configured,
            unknown,
            configured_late: configured_late.into_iter().flatten().collect(),
            unknown_late: unknown_late.into_iter().flatten().collect(),
            ..task.row
        });
    }
    rows.extend(base_rows(&mut |done, _| progress(responses + done, total))?);
    Ok(rows)
}

/// Returns the verdict on one motor of the task: the motor with the largest rms error in the last second.
fn worst(task: &Task, late: bool, knowledge: Knowledge, period_ms: u32) -> Result<Verdict, StudyError> {
    let mut worst: Option<Verdict> = None;
    for scenario in &task.scenarios {
        let mut scenario = parallel::variant(scenario, knowledge, period_ms)?;
        if late {
            // Set-points and torques at 0 s are not delayed.
            for motor in &mut scenario.motors {
                let setpoints = motor.setpoints.iter_mut().map(|timed| &mut timed.at_s);
                let torques = motor.torques.iter_mut().map(|timed| &mut timed.at_s);
                setpoints.chain(torques).filter(|at_s| **at_s > 0.0).for_each(|at_s| *at_s += LATE_S);
            }
        }
        let motor = scenario.motors.first().ok_or(StudyError::NoEvent)?;
        let changes = changes(motor, scenario.duration_s);
        let change = changes.get(task.response).ok_or(StudyError::NoEvent)?;
        let verdict = judge(change, watch(&scenario)?.first().ok_or(StudyError::NoEvent)?);
        if worst.is_none_or(|worst| worst.last_rms < verdict.last_rms) {
            worst = Some(verdict);
        }
    }
    worst.ok_or(StudyError::NoEvent)
}

/// Name of each task of a drive base, and the courses of the base in the form of a scenario file.
///
/// The drive base is the base in `tests/scenarios/drive-bases.toml`: two unequal NeveRest 60 under a robot of 6 kg, on
/// wheels of 90 mm that are 300 mm apart.
const BASE_TASKS: [(&str, &str); 2] = [
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

fn base_scenario(courses: &str) -> Result<Scenario, StudyError> {
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

/// The rows of [`BASE_TASKS`]. `progress` gets the number of finished runs and the number of all runs.
fn base_rows(progress: &mut dyn FnMut(usize, usize)) -> Result<Vec<Row>, StudyError> {
    let scenarios =
        BASE_TASKS.iter().map(|(_, courses)| base_scenario(courses)).collect::<Result<Vec<_>, _>>()?;
    let degrees = parallel::at_all_periods(&scenarios, &PERIODS, heading_error, progress)?;
    let rows = BASE_TASKS.iter().zip(degrees).map(|((name, _), [configured_degrees, unknown_degrees])| Row {
        name: (*name).to_owned(),
        figure: Figure::Heading,
        configured_degrees,
        unknown_degrees,
        ..Row::default()
    });
    Ok(rows.collect())
}

/// The largest heading error of a run in degrees; infinite after a fault of a wheel's encoder.
fn heading_error(scenario: &Scenario, knowledge: Knowledge, period_ms: u32) -> Result<f64, StudyError> {
    let scenario = parallel::variant(scenario, knowledge, period_ms)?;
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
