//! Odometry of a drive base: position and heading from the counts of both wheels, and from a gyro if there is one.
//!
//! In each step the base moves along a short arc, whose length is the mean distance of the wheels. The wheels also give
//! the angle of the arc, until a reading of the gyro replaces this angle. Wheels of unlike diameters, a wrong track
//! width and slip in turns make the wheels' angle wrong, but not the gyro's.
//!
//! The *slip* is the angle by which the wheels have turned the base according to their counts, minus the heading. To
//! reach a heading, the wheels must turn further by the slip.

use super::DriveBase;
use core::f64::consts::PI;

/// Position and heading of a drive base. The x axis points forward at the start, the y axis to the left.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pose {
    /// Distance forward from the start in mm.
    pub x_mm: f64,
    /// Distance to the left of the start in mm.
    pub y_mm: f64,
    /// Angle by which the base has turned left, in degrees. The angle does not wrap at 360 degrees.
    pub heading_degrees: f64,
}

/// State of a drive base's gyro.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum GyroState {
    /// The base does not use a gyro.
    #[default]
    Unused,
    /// The gyro has given no reading yet. The base holds its heading by the encoders.
    Waiting,
    /// The base holds the heading of the gyro.
    Good,
    /// The gyro gives no readings any more. The base holds its heading by the encoders.
    Lost,
    /// The gyro has not turned with the wheels: the gyro is mounted upside down, or the wheels spin and do not turn the
    /// base. The base holds its heading by the encoders until it is configured again.
    Implausible,
}

/// Position and heading of a drive base, step by step.
///
/// ```
/// use motor_hub::group::{DriveBase, Odometry};
///
/// let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0; 2] };
/// let mut odometry = Odometry::new(base, [0, 0]);
/// // A metre forward, then a quarter turn to the left that the gyro measures as 88 degrees.
/// let [left, right] = base.straight(1_000.0)?;
/// odometry.step([left, right], Some(359.0));
/// let [back, forth] = base.turn(90.0)?;
/// let pose = odometry.step([left + back, right + forth], Some(87.0));
/// assert!((pose.x_mm - 1_000.0).abs() < 0.2 && pose.y_mm.abs() < 0.2);
/// assert_eq!(pose.heading_degrees, 88.0);
/// assert!((odometry.slip_degrees() - 2.0).abs() < 0.01);
/// # Ok::<(), motor_hub::units::RangeError>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Odometry {
    base: DriveBase,
    /// Counts of both wheels at the last step.
    counts: [i32; 2],
    /// Angle of the gyro at its last reading. `None` before the first reading, and after the gyro was lost.
    gyro_degrees: Option<f64>,
    /// Angle by which the wheels have turned the base since the last reading of the gyro.
    since_gyro_degrees: f64,
    slip_degrees: f64,
    pose: Pose,
}

impl Odometry {
    /// Starts at the origin, with the counts of both wheels.
    pub const fn new(base: DriveBase, counts: [i32; 2]) -> Self {
        let pose = Pose { x_mm: 0.0, y_mm: 0.0, heading_degrees: 0.0 };
        Self { base, counts, gyro_degrees: None, since_gyro_degrees: 0.0, slip_degrees: 0.0, pose }
    }

    /// Updates the pose from the counts of both wheels, which may wrap, and from a new reading of the gyro. The angle
    /// of the gyro grows to the left, and may wrap at 360 degrees. `None` if the gyro has no new reading.
    ///
    /// Between two readings the base must turn by less than 180 degrees.
    pub fn step(&mut self, counts: [i32; 2], gyro_degrees: Option<f64>) -> Pose {
        let [left, right] = counts;
        let [last_left, last_right] = self.counts;
        let moved = [left.wrapping_sub(last_left), right.wrapping_sub(last_right)];
        let by_wheels = self.base.heading(moved);
        let since_gyro = self.since_gyro_degrees + by_wheels;
        let turned_degrees = match (self.gyro_degrees, gyro_degrees) {
            (Some(last), Some(now)) => within_half_a_turn(now - last) - self.since_gyro_degrees,
            _ => by_wheels,
        };
        self.since_gyro_degrees = if gyro_degrees.is_some() { 0.0 } else { since_gyro };
        (self.counts, self.gyro_degrees) = (counts, gyro_degrees.or(self.gyro_degrees));
        let distance_mm = self.base.distance(moved);
        let (sin, cos) = libm::sincos((self.pose.heading_degrees + 0.5 * turned_degrees) * (PI / 180.0));
        self.pose.x_mm += distance_mm * cos;
        self.pose.y_mm += distance_mm * sin;
        self.pose.heading_degrees += turned_degrees;
        self.slip_degrees += by_wheels - turned_degrees;
        self.pose
    }

    /// Continues the heading with the wheels alone. The next reading of the gyro is treated as its first reading: only
    /// later changes of its angle turn the heading.
    pub const fn lose_gyro(&mut self) {
        self.gyro_degrees = None;
    }

    /// Returns the slip in degrees, positive if the wheels have turned the base less to the left than their counts say.
    pub const fn slip_degrees(&self) -> f64 {
        self.slip_degrees
    }

    /// Returns the present pose.
    pub const fn pose(&self) -> Pose {
        self.pose
    }
}

/// Returns the same direction as an angle from -180 to 180 degrees.
fn within_half_a_turn(degrees: f64) -> f64 {
    degrees - 360.0 * libm::round(degrees / 360.0)
}
