//! The square of UMBmark (Borenstein and Feng, 1996): a drive base drives round a square of 4 m, once to the left and
//! once to the right. The results are the distance of the base from its start and the error of its heading at the end.
//!
//! The base differs from its configuration: the wheels differ by 1 %, the track is 2 % wider, and the wheels lose 5 %
//! of each turn. The heading is from the encoders, from encoders that are calibrated by one run, or from a gyro. The
//! gyro has no errors, or a drift and a scale error, or both errors after a calibration of the scale. The hub's own
//! tasks run on the simulated board, with the driver of the gyro and the simulated BNO055.

use crate::StudyError;
use crate::page::Page;
use crate::table;
use motor_hub::group::{Course, DriveBase, GroupCommand, Pose};
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use motor_hub::model::si::KgM2;
use motor_hub::units::{Acceleration, CountsPerSecond};
use simulated::bno055::GyroErrors;
use simulated::ground::Floor;
use simulated::scenario::{Group, Motor, Scenario, Timed};
use simulated::sim;

/// Length of a side in mm.
const SIDE_MM: f64 = 4_000.0;
/// The base as the hub is first configured for it: wheels of 90 mm on the output shafts of two motors, 300 mm apart.
const BASE: DriveBase = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0; 2] };
/// True dimensions and slip of the base.
const FLOOR: Floor = Floor { wheel_diameters_mm: [90.45, 89.55], track_mm: 306.0, slip_in_turns: 0.05 };
/// Speed of the wheels in counts/s, which is 0.35 m/s.
const SPEED_CPS: i32 = 2_080;
/// Acceleration of the wheels in counts/s², which is 0.7 m/s².
const ACCELERATION_CPS2: u32 = 4_160;
/// Time from the start of a side to the start of the next motion, in seconds. The motion on the side is shorter.
const SIDE_S: f64 = 13.0;
/// Time from the start of a turn to the start of the next motion, in seconds. The turn itself is shorter.
const TURN_S: f64 = 2.5;
/// Errors of a gyro. The scale error is the limit in the data sheet of a BNO055; the drift is what remains after the
/// sensor's own calibration.
const WORSE_GYRO: GyroErrors = GyroErrors { drift_degrees_per_min: 0.5, scale_error: 0.01 };
/// Inertia of half of a robot of 6 kg, acting at the rim of a wheel.
const WHEEL: Load = Load::inertia(KgM2(3.0 * 0.045 * 0.045));

/// How a base ends after a square.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct End {
    /// True distance from the start in mm.
    pub distance_mm: f64,
    /// True heading minus the heading of a whole turn, in degrees.
    pub heading_degrees: f64,
    /// Distance between the true position and the position that the hub reports, in mm. `None` for a base without a
    /// gyro, whose odometry the scenario does not read.
    pub odometry_mm: Option<f64>,
}

/// The squares in both directions with one source of the heading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Squares {
    /// Name of the source of the heading.
    pub name: &'static str,
    /// The ends of the squares to the left and to the right.
    pub ends: [End; 2],
}

/// Drives all squares.
pub fn run() -> Result<[Squares; 5], StudyError> {
    let both = |name, base: DriveBase, gyro, turn| -> Result<Squares, StudyError> {
        Ok(Squares { name, ends: [drive(base, gyro, turn)?, drive(base, gyro, -turn)?] })
    };
    let encoders = both("encoders", BASE, None, 90.0)?;
    let calibrated = both("encoders, calibrated by one run", calibrated(encoders.ends), None, 90.0)?;
    let gyro = both("gyro without errors", BASE, Some(GyroErrors::default()), 90.0)?;
    let worse = both("gyro with drift and scale error", BASE, Some(WORSE_GYRO), 90.0)?;
    // The drift turns both squares to the same side, and the scale error turns them to different sides.
    let [left, right] = worse.ends.map(|end| end.heading_degrees);
    let turn = 90.0 * (360.0 / (360.0 + 0.5 * (left - right)));
    let scaled = both("that gyro, its scale calibrated by one run", BASE, Some(WORSE_GYRO), turn)?;
    Ok([encoders, calibrated, gyro, worse, scaled])
}

/// Drives one square. `turn` is the angle that each turn commands, in degrees to the left. Without a gyro the heading is
/// from the encoders.
fn drive(base: DriveBase, gyro: Option<GyroErrors>, turn: f64) -> Result<End, StudyError> {
    let acceleration = Acceleration::new(ACCELERATION_CPS2)?;
    let mut courses = Vec::new();
    let mut at_s = 0.5;
    for _ in 0..4 {
        for ([left, right], time_s) in [(base.straight(SIDE_MM)?, SIDE_S), (base.turn(turn)?, TURN_S)] {
            let course = Course::distances(&[(0, left), (1, right)])?;
            let value = GroupCommand::new(course, CountsPerSecond::new(SPEED_CPS), acceleration);
            courses.push(Timed { at_s, value });
            at_s += time_s;
        }
    }
    let motor = characterised("NeveRest 60")?.with_measured_rotor_inertia();
    let group = Group {
        label: "base".into(),
        motors: vec![0, 1],
        base: Some(base),
        use_gyro: gyro.is_some(),
        courses,
    };
    let scenario = Scenario {
        floor: FLOOR,
        gyro: gyro.unwrap_or_default(),
        groups: vec![group],
        ..Scenario::new("square", at_s, vec![Motor::new(motor, WHEEL); 2])
    };
    let trace = sim::run(&scenario, &mut |_| ())?;
    let end = trace.ticks.last().ok_or(StudyError::NoEvent)?;
    let Pose { x_mm, y_mm, heading_degrees } = end.pose;
    Ok(End {
        distance_mm: x_mm.hypot(y_mm),
        heading_degrees: heading_degrees - 360.0f64.copysign(turn),
        odometry_mm: end
            .base
            .map(|base| (f64::from(base.x_um) / 1e3 - x_mm).hypot(f64::from(base.y_um) / 1e3 - y_mm)),
    })
}

/// The base as calibrated by the headings at the ends of both squares. UMBmark itself uses the positions at the ends.
/// Its formulas need small angles, and the errors here are too large for them.
fn calibrated([left, right]: [End; 2]) -> DriveBase {
    let (ccw, cw) = (left.heading_degrees, right.heading_degrees);
    // A side bends by `side` degrees to the left. A turn misses `turn` degrees.
    let (side, turn) = ((ccw + cw) / 8.0, (ccw - cw) / 8.0);
    let track_mm = BASE.track_mm * 90.0 / (90.0 + turn);
    let ratio = side.to_radians() * track_mm / SIDE_MM;
    let counts_per_turn = [1680.0 * (1.0 + 0.5 * ratio), 1680.0 * (1.0 - 0.5 * ratio)];
    DriveBase { track_mm, counts_per_turn, ..BASE }
}

/// A page with a table of all squares.
pub fn page(all: &[Squares]) -> Page {
    let odometry = |ends: &[End; 2]| {
        let [left, right] = ends.map(|end| end.odometry_mm);
        left.zip(right).map_or_else(|| "-".to_owned(), |(left, right)| format!("{:.0}", left.max(right)))
    };
    let table = table::of(
        all,
        1,
        &[
            ("heading by", &|squares| squares.name.to_owned()),
            ("end left, mm", &|squares| format!("{:.0}", squares.ends[0].distance_mm)),
            ("end right, mm", &|squares| format!("{:.0}", squares.ends[1].distance_mm)),
            ("heading left, degrees", &|squares| format!("{:.2}", squares.ends[0].heading_degrees)),
            ("right, degrees", &|squares| format!("{:.2}", squares.ends[1].heading_degrees)),
            ("odometry off by, mm", &|squares| odometry(&squares.ends)),
        ],
    );
    let mut page = Page::new(
        "A drive base drives round a square of 4 m, to the left and to the right, and ends where it began, if its heading is right. Its \
         wheels are 1 % unlike, its track is 2 % wider than configured, and its wheels lose 5 % of each turn by slipping. The table has the \
         true distances from the start, and the true errors of the heading, at the end. The odometry is the hub's own.",
    );
    page.text(
        "The simulated gyro has the resolution of a BNO055. In the third row it has no other error. In the fourth row it drifts to the \
         left by 0.5 degrees a minute, and its turns are 1 % too large. A square takes a minute and turns by 360 degrees, so the \
         heading then has an error above the 0.5 degrees of the third row. A hub with one gyro cannot measure the errors of this gyro. \
         The last row enlarges each turn by a factor from the headings of the fourth row, which leaves the drift. The calibration of \
         the encoders takes the headings at the ends of the first row.",
    );
    page.table("The square of UMBmark", table);
    page
}
