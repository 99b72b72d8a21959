//! Motors that move in step.

mod base;
#[path = "../common/mod.rs"]
mod common;
mod gyro;
mod motors;
mod odometry;
mod references;

use motor_hub::group::{Course, DriveBase, GroupCommand};
use motor_hub::model::load::Load;
use motor_hub::model::si::KgM2;
use motor_hub::units::{Acceleration, CountsPerSecond};

/// Wheels of 90 mm, 300 mm apart, each on the output of a NeveRest 60.
const BASE: DriveBase = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0; 2] };
/// Half of a robot of 6 kg at the rim of a wheel.
const WHEEL: Load = Load { inertia_after: KgM2(3.0 * 0.045 * 0.045), ..Load::NONE };

fn numbered<T: Copy, const N: usize>(values: [T; N]) -> Vec<(usize, T)> {
    values.into_iter().enumerate().collect()
}

/// Motors 0, 1, ... move by these distances in counts.
fn by<const N: usize>(counts: [i32; N]) -> Course {
    Course::distances(&numbered(counts)).expect("motors")
}

/// Motors 0, 1, ... move to these positions in counts.
fn to<const N: usize>(counts: [i32; N]) -> Course {
    Course::positions(&numbered(counts)).expect("motors")
}

/// Motors 0, 1, ... turn on at these speeds in counts/s.
fn on<const N: usize>(cps: [i32; N]) -> Course {
    Course::velocities(&numbered(cps.map(CountsPerSecond::new))).expect("motors")
}

/// A usual command at a speed in counts/s with an acceleration in counts/s2.
fn usual(course: Course, cps: i32, cps2: u32) -> GroupCommand {
    GroupCommand::new(course, CountsPerSecond::new(cps), Acceleration::new(cps2).expect("above 0"))
}
