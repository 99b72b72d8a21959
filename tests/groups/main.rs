//! Motors that move in step.

mod base;
#[path = "../common/mod.rs"]
mod common;
mod gyro;
mod motors;
mod odometry;
mod references;

use motor_hub::group::DriveBase;
use motor_hub::model::load::Load;
use motor_hub::model::si::KgM2;

/// Wheels of 90 mm, 300 mm apart, each on the output of a NeveRest 60.
const BASE: DriveBase = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0; 2] };
/// Half of a robot of 6 kg at the rim of a wheel.
const WHEEL: Load = Load { inertia_after: KgM2(3.0 * 0.045 * 0.045), ..Load::NONE };
