//! A drive base with two wheels: converts distances and headings to encoder counts and back.

use crate::units::{CountsPerSecond, RangeError, nearest};
use core::f64::consts::PI;

/// A drive base with a driven wheel on the left and one on the right.
///
/// Positive distances are forward. Positive headings are to the left: counter-clockwise, seen from above. A motor that
/// is mounted mirrored counts down while its wheel drives forward. The number of counts per turn of such a wheel is
/// negative.
///
/// ```
/// use motor_hub::group::DriveBase;
/// use motor_hub::units::{CountsPerSecond, constant};
///
/// // NeveRest 60 on both sides, the right one mirrored.
/// const BASE: DriveBase =
///     DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0, -1680.0] };
/// const METRE: [i32; 2] = constant!(BASE.straight(1000.0));
/// const LEFT: [i32; 2] = constant!(BASE.turn(90.0));
/// const BRISK: [CountsPerSecond; 2] = constant!(BASE.speeds(400.0, 0.0));
/// assert_eq!((METRE, LEFT), ([5942, -5942], [-1400, -1400]));
/// assert_eq!(BRISK.map(CountsPerSecond::round), [2377, -2377]);
/// assert!((BASE.heading(LEFT) - 90.0).abs() < 0.01);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveBase {
    /// Diameter of both wheels in mm, above 0.
    pub wheel_diameter_mm: f64,
    /// Distance between the centres of the wheels in mm, above 0.
    pub track_mm: f64,
    /// Encoder counts per turn of the left and of the right wheel, not 0. Negative for a motor that counts down while
    /// its wheel drives forward.
    pub counts_per_turn: [f64; 2],
}

impl DriveBase {
    /// Returns the counts of the left and the right wheel for a straight distance. Negative distances are backwards.
    ///
    /// # Errors
    /// [`RangeError::Distance`] if a wheel would move by more than 2^31 - 1 counts.
    pub const fn straight(&self, mm: f64) -> Result<[i32; 2], RangeError> {
        self.arc(mm, 0.0)
    }

    /// Returns the counts of both wheels for a turn on the spot. Positive angles are to the left.
    ///
    /// # Errors
    /// [`RangeError::Distance`] if a wheel would move by more than 2^31 - 1 counts.
    pub const fn turn(&self, degrees: f64) -> Result<[i32; 2], RangeError> {
        self.arc(0.0, degrees)
    }

    /// Returns the counts of both wheels for an arc. `mm` is the distance of the point between the wheels, `degrees` the
    /// change of the heading.
    ///
    /// # Errors
    /// [`RangeError::Distance`] if a wheel would move by more than 2^31 - 1 counts.
    pub const fn arc(&self, mm: f64, degrees: f64) -> Result<[i32; 2], RangeError> {
        let [left, right] = self.counts(mm, degrees);
        match (to_i32(left), to_i32(right)) {
            (Some(left), Some(right)) => Ok([left, right]),
            _ => Err(RangeError::Distance),
        }
    }

    /// Returns the speeds of both wheels for a forward speed in mm/s and a speed of turning left in degrees per second.
    ///
    /// # Errors
    /// [`RangeError::Speed`] if a speed is out of the range of [`CountsPerSecond`].
    pub const fn speeds(&self, mm: f64, degrees: f64) -> Result<[CountsPerSecond; 2], RangeError> {
        let [left, right] = self.counts(mm, degrees);
        match (CountsPerSecond::from_rpm(60.0 * left, 1.0), CountsPerSecond::from_rpm(60.0 * right, 1.0)) {
            (Ok(left), Ok(right)) => Ok([left, right]),
            _ => Err(RangeError::Speed),
        }
    }

    /// Returns the distance in mm that the point between the wheels has moved, from the counts of both wheels.
    pub const fn distance(&self, counts: [i32; 2]) -> f64 {
        let [left, right] = self.distances_mm(counts);
        (left + right) / 2.0
    }

    /// Returns the angle in degrees by which the base has turned left, from the counts of both wheels.
    pub const fn heading(&self, counts: [i32; 2]) -> f64 {
        let [left, right] = self.distances_mm(counts);
        (right - left) / self.track_mm * (180.0 / PI)
    }

    /// Returns the counts of both wheels, not rounded.
    const fn counts(&self, mm: f64, degrees: f64) -> [f64; 2] {
        let [left, right] = self.counts_per_turn;
        let turn_mm = degrees * (PI / 180.0) * self.track_mm / 2.0;
        let circumference_mm = PI * self.wheel_diameter_mm;
        [(mm - turn_mm) / circumference_mm * left, (mm + turn_mm) / circumference_mm * right]
    }

    /// Returns the distance of each wheel in mm.
    const fn distances_mm(&self, counts: [i32; 2]) -> [f64; 2] {
        let [left, right] = counts;
        let [left_per_turn, right_per_turn] = self.counts_per_turn;
        let circumference_mm = PI * self.wheel_diameter_mm;
        [left as f64 / left_per_turn * circumference_mm, right as f64 / right_per_turn * circumference_mm]
    }
}

/// Rounds to a whole number of counts; `None` beyond +-(2^31 - 1) and for NaN.
const fn to_i32(counts: f64) -> Option<i32> {
    match nearest(counts) {
        Some(counts) if counts.unsigned_abs() <= i32::MAX as u64 => Some(counts as i32),
        _ => None,
    }
}
