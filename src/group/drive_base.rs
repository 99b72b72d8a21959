//! Two wheels beside each other: distances and headings in counts, and back.

use crate::units::{CountsPerSecond, RangeError, nearest};
use core::f64::consts::PI;

/// Two driven wheels, left and right, with a track between them.
///
/// Positive counts of either wheel are taken to drive forward, and positive headings to turn left, that is
/// counter-clockwise seen from above. A wheel whose motor is mounted the other way round has a negative
/// number of counts in a turn.
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
    /// Of both wheels, above 0.
    pub wheel_diameter_mm: f64,
    /// Between the middles of the wheels, above 0.
    pub track_mm: f64,
    /// Encoder counts in a turn of the wheel, left and right; not 0.
    pub counts_per_turn: [f64; 2],
}

impl DriveBase {
    /// Counts of either wheel for a way straight ahead; negative is back.
    ///
    /// # Errors
    /// [`RangeError::Way`] beyond 2^31 - 1 counts.
    pub const fn straight(&self, mm: f64) -> Result<[i32; 2], RangeError> {
        self.arc(mm, 0.0)
    }

    /// Counts of either wheel for a turn on the spot, to the left.
    ///
    /// # Errors
    /// [`RangeError::Way`] beyond 2^31 - 1 counts.
    pub const fn turn(&self, degrees: f64) -> Result<[i32; 2], RangeError> {
        self.arc(0.0, degrees)
    }

    /// Counts of either wheel for a way of the middle between them on which the heading changes by so much.
    ///
    /// # Errors
    /// [`RangeError::Way`] beyond 2^31 - 1 counts.
    pub const fn arc(&self, mm: f64, degrees: f64) -> Result<[i32; 2], RangeError> {
        let [left, right] = self.counts(mm, degrees);
        match (whole(left), whole(right)) {
            (Some(left), Some(right)) => Ok([left, right]),
            _ => Err(RangeError::Way),
        }
    }

    /// Speeds of either wheel for a speed ahead in mm/s, and one of turning to the left in degrees per second.
    ///
    /// # Errors
    /// [`RangeError::Speed`] beyond the range of a speed.
    pub const fn speeds(&self, mm: f64, degrees: f64) -> Result<[CountsPerSecond; 2], RangeError> {
        let [left, right] = self.counts(mm, degrees);
        match (CountsPerSecond::from_rpm(60.0 * left, 1.0), CountsPerSecond::from_rpm(60.0 * right, 1.0)) {
            (Ok(left), Ok(right)) => Ok([left, right]),
            _ => Err(RangeError::Speed),
        }
    }

    /// How far the middle between the wheels has come, in mm, when they have moved so many counts.
    pub const fn distance(&self, counts: [i32; 2]) -> f64 {
        let [left, right] = self.ways(counts);
        (left + right) / 2.0
    }

    /// How far the base has turned to the left, in degrees, when its wheels have moved so many counts.
    pub const fn heading(&self, counts: [i32; 2]) -> f64 {
        let [left, right] = self.ways(counts);
        (right - left) / self.track_mm * (180.0 / PI)
    }

    const fn counts(&self, mm: f64, degrees: f64) -> [f64; 2] {
        let [left, right] = self.counts_per_turn;
        let sideways = degrees * (PI / 180.0) * self.track_mm / 2.0;
        let round = PI * self.wheel_diameter_mm;
        [(mm - sideways) / round * left, (mm + sideways) / round * right]
    }

    const fn ways(&self, counts: [i32; 2]) -> [f64; 2] {
        let [left, right] = counts;
        let [of_left, of_right] = self.counts_per_turn;
        let round = PI * self.wheel_diameter_mm;
        [left as f64 / of_left * round, right as f64 / of_right * round]
    }
}

const fn whole(counts: f64) -> Option<i32> {
    match nearest(counts) {
        Some(counts) if counts.unsigned_abs() <= i32::MAX as u64 => Some(counts as i32),
        _ => None,
    }
}
