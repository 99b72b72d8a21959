//! Reference tasks at several control periods. The reference figures are from a simulation that was made before the
//! regulator was written. Tasks of a drive base have no reference figures: the result is the largest difference between
//! the heading of the base and the heading of its references.

use super::responses::{self, Instant, Verdict};
use super::{Knowledge, parallel};
use crate::groups::HeadingError;
use crate::{StudyError, position, timed, velocity};
use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use motor_hub::model::si::{Drag, KgM2, Volts};
use motor_hub::motor::Setpoint;
use motor_hub::units::CountsPerSecond;
use serde::Serialize;
use simulated::scenario::{Motor, Scenario, Timed};

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

struct Task {
    /// The row of the task, without results.
    row: Row,
    /// One scenario for each motor.
    scenarios: Vec<Scenario>,
    /// Index of the response in the scenario. A drive base has none.
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

fn tasks() -> Result<Vec<Task>, StudyError> {
    let flywheel = |speeds: &[(f64, i32)]| plan("AM 20 A", 0.006, velocities(speeds));
    let winch = |speeds: &[(f64, i32)]| plan("AM 60 A", 0.05, velocities(speeds));
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
    use Figure::{Heading, Offset, Rms, Settling};
    let up_and_down = flywheel(&[(0.5, 2330), (5.0, 875)])?;
    task("flywheel 0 -> 2330", "0.35/0.4", Settling, 0, vec![up_and_down.clone()]);
    task("flywheel 80 -> 30 %", "0.19/0.5", Settling, 1, vec![up_and_down]);
    let pushed = with_torque(winch(&[(0.5, 1360)])?, 0.8);
    task("winch 0 -> 1360", "0.27/0.4", Settling, 0, vec![pushed.clone()]);
    task("winch +0.8 N m", "0.23/10.2", Settling, 1, vec![pushed]);
    task("winch 2176 -> 816", "0.20/0.4", Settling, 1, vec![winch(&[(0.5, 2176), (4.0, 816)])?]);
    task("winch 1632 -> -1632", "0.44/0.1", Settling, 1, vec![winch(&[(0.5, 1632), (4.0, -1632)])?]);
    let arm = arm()?;
    task("arm 0 -> 4000", "2.48/0.1", Settling, 0, vec![arm.clone()]);
    task("arm 4000 -> 500", "2.18/0", Settling, 1, vec![arm.clone()]);
    task("arm 4000 -> 500, last error", "<= 1 count", Offset, 1, vec![arm]);
    let to =
        |motor, inertia, counts| plan(motor, inertia, vec![(0.5, position(counts, CountsPerSecond::MAX))]);
    task("0.5 kg m2 0 -> 5000", "4.08/0", Settling, 0, vec![to("AM 60 A", 0.5, 5000)?]);
    task("Matrix 12 V bare 0 -> 3000", "1.36/0.1", Settling, 0, vec![to("Matrix A", 0.0, 3000)?]);
    let held = with_torque(to("AM 60 A", 0.05, 0)?, 0.4);
    task("winch 0, +0.4 N m: offset", "14 counts", Offset, 1, vec![held]);
    for (friction, name, references) in [
        (0.0, "", ["0.9 %", "0.5 %", "0.9 %", "1.2 %"]),
        (5.0, ", 5 % friction", ["0.8 %", "0.6 %", "0.9 %", "1.0 %"]),
    ] {
        for (cps, reference) in [5, 10, 20, 50].into_iter().zip(references) {
            let mut scenarios = Vec::new();
            for motor in CRAWLERS {
                let mut scenario = plan(motor, 0.0, velocities(&[(0.0, cps)]))?;
                scenario.motors.iter_mut().for_each(|motor| motor.set_friction(friction));
                scenarios.push(scenario);
            }
            task(&format!("{cps} counts/s{name}, rms"), reference, Rms, 0, scenarios);
        }
    }
    for (name, courses) in BASE_TASKS {
        task(name, "", Heading, 0, vec![base(courses)?]);
    }
    Ok(all)
}

fn velocities(speeds: &[(f64, i32)]) -> Vec<(f64, Setpoint)> {
    speeds.iter().map(|&(at_s, cps)| (at_s, velocity(cps))).collect()
}

/// A motor alone, with an inertia in kg m² on its output shaft, and its set-points with their times in seconds.
fn plan(motor: &str, inertia: f64, setpoints: Vec<(f64, Setpoint)>) -> Result<Scenario, StudyError> {
    let constants = characterised(motor)?.with_measured_rotor_inertia();
    let motor = Motor { setpoints: timed(setpoints), ..Motor::new(constants, Load::inertia(KgM2(inertia))) };
    let mut scenario = Scenario::new("reference", 10.0, vec![motor]);
    scenario.battery.emf = Volts(12.6);
    Ok(scenario)
}

/// The scenario with a torque in newton metres from 4 s on.
fn with_torque(mut scenario: Scenario, value: f64) -> Scenario {
    for motor in &mut scenario.motors {
        motor.torques.push(Timed { at_s: 4.0, value });
    }
    scenario
}

/// The arm of the default scenario, but with the tolerance of the other tasks.
fn arm() -> Result<Scenario, StudyError> {
    let to = |counts| position(counts, CountsPerSecond::new(1800));
    let mut scenario = plan("AM 40 C", 0.02, vec![(0.0, to(4000)), (5.0, to(500))])?;
    for motor in &mut scenario.motors {
        motor.scheme = Scheme::B;
        motor.load.drag_after = Drag(0.005);
        motor.torques = timed([(0.0, -0.3)]);
    }
    Ok(scenario)
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

fn base(courses: &str) -> Result<Scenario, StudyError> {
    let text = format!(
        r#"
name = "drive base"
duration_s = 6.5
battery = {{ emf_v = 12.0, resistance_ohm = 0.05 }}
motors = [
    {{ label = "left", motor = "AM 60 A", load = {{ inertia_kg_m2 = 0.006075 }} }},
    {{ label = "right", motor = "AM 60 B", load = {{ inertia_kg_m2 = 0.006075 }} }},
]
[[groups]]
label = "base"
motors = ["left", "right"]
base = {{ wheel_diameter_mm = 90, track_mm = 300 }}
courses = [{courses}]
"#
    );
    // A test shows that the text is valid, so this error does not occur.
    Scenario::parse("drive base", &text).map_err(|_| StudyError::NoEvent)
}

/// Runs all tasks at all [`PERIODS`], configured exactly and not configured. `progress` gets the number of finished
/// tasks and the number of all tasks.
pub fn run(progress: &mut dyn FnMut(usize, usize)) -> Result<Vec<Row>, StudyError> {
    parallel::map(&tasks()?, Task::run, progress)
}

fn at_all_periods<T>(run: impl Fn(u32) -> Result<T, StudyError>) -> Result<Vec<T>, StudyError> {
    PERIODS.into_iter().map(run).collect()
}

impl Task {
    fn run(&self) -> Result<Row, StudyError> {
        let degrees = |knowledge| at_all_periods(|ms| self.heading_error(knowledge, ms));
        let verdicts = |late_s, knowledge| at_all_periods(|ms| self.worst(late_s, knowledge, ms));
        let mut row = self.row.clone();
        if row.figure == Figure::Heading {
            row.configured_degrees = degrees(Knowledge::EXACT)?;
            row.unknown_degrees = degrees(Knowledge::UNKNOWN)?;
            return Ok(row);
        }
        row.configured = verdicts(0.0, Knowledge::EXACT)?;
        row.unknown = verdicts(0.0, Knowledge::UNKNOWN)?;
        if row.figure == Figure::Settling {
            row.configured_late = verdicts(LATE_S, Knowledge::EXACT)?;
            row.unknown_late = verdicts(LATE_S, Knowledge::UNKNOWN)?;
        }
        Ok(row)
    }

    /// The verdict on one motor of the task: the motor with the largest rms error in the last second. Changes come
    /// `late_s` seconds after a tick.
    fn worst(&self, late_s: f64, knowledge: Knowledge, period_ms: u32) -> Result<Verdict, StudyError> {
        let mut worst: Option<Verdict> = None;
        for scenario in &self.scenarios {
            let mut scenario = knowledge.at_period(scenario, period_ms)?;
            // Set-points and torques at 0 s are not delayed.
            for motor in &mut scenario.motors {
                let setpoints = motor.setpoints.iter_mut().map(|timed| &mut timed.at_s);
                let torques = motor.torques.iter_mut().map(|timed| &mut timed.at_s);
                setpoints.chain(torques).filter(|at_s| **at_s > 0.0).for_each(|at_s| *at_s += late_s);
            }
            let verdict = *responses::verdicts(&scenario)?.get(self.response).ok_or(StudyError::NoEvent)?;
            if worst.is_none_or(|worst| worst.last_rms < verdict.last_rms) {
                worst = Some(verdict);
            }
        }
        worst.ok_or(StudyError::NoEvent)
    }

    /// The largest heading error of a drive base in degrees; infinite after a fault of a wheel's encoder.
    fn heading_error(&self, knowledge: Knowledge, period_ms: u32) -> Result<f64, StudyError> {
        let scenario = self.scenarios.first().ok_or(StudyError::NoEvent)?;
        let scenario = knowledge.at_period(scenario, period_ms)?;
        let group = scenario.groups.first().ok_or(StudyError::NoEvent)?;
        let mut heading = HeadingError::new(group, &scenario.motors).ok_or(StudyError::NoEvent)?;
        let tracks = responses::watch(&scenario)?;
        if tracks.iter().flatten().any(|at| at.report.faults.encoder.is_some()) {
            return Ok(f64::INFINITY);
        }
        // Between two ticks the references do not change.
        let ticks = (0..(1e3 * scenario.duration_s) as usize).step_by(period_ms as usize);
        let errors = ticks.filter_map(|ms| {
            let wheel = |motor: usize| {
                let Instant { point, report } = tracks.get(motor)?.get(ms)?;
                Some((report.setpoint, point.counts))
            };
            heading.step(ms as f64 / 1e3, wheel)
        });
        Ok(errors.fold(0.0, f64::max))
    }
}
