//! A drive base with two wheels: converts distances and headings to encoder counts and back.

use crate::units::{CountsPerSecond, RangeError, nearest};
use core::f64::consts::PI;
use core::ops::RangeInclusive;

/// A drive base with a driven wheel on each side.
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

    /// Returns the counts of both wheels for an arc. `mm` is the distance of the point between the wheels, `degrees`
    /// the change of the heading.
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

    /// Returns the counts of both wheels for an arc as [`arc`](Self::arc) does, but without rounding. A host adds up
    /// the parts of a course in these counts, and so avoids a sum of rounding errors.
    pub const fn counts(&self, mm: f64, degrees: f64) -> [f64; 2] {
        let [left, right] = self.counts_per_turn;
        let turn_mm = degrees * (PI / 180.0) * self.track_mm / 2.0;
        let circumference_mm = PI * self.wheel_diameter_mm;
        [(mm - turn_mm) / circumference_mm * left, (mm + turn_mm) / circumference_mm * right]
    }

    /// Returns the speeds of both wheels for a forward speed in mm/s and a speed of turning left in degrees per second.
    ///
    /// # Errors
    /// [`RangeError::Speed`] if a speed is out of the range of [`CountsPerSecond`].
    pub const fn speeds(
        &self,
        mm_per_s: f64,
        degrees_per_s: f64,
    ) -> Result<[CountsPerSecond; 2], RangeError> {
        let [left, right] = self.counts(mm_per_s, degrees_per_s);
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

    /// Returns the distance of each wheel in mm.
    const fn distances_mm(&self, counts: [i32; 2]) -> [f64; 2] {
        let [left, right] = counts;
        let [left_per_turn, right_per_turn] = self.counts_per_turn;
        let circumference_mm = PI * self.wheel_diameter_mm;
        [left as f64 / left_per_turn * circumference_mm, right as f64 / right_per_turn * circumference_mm]
    }
}

/// Configuration of a hub's drive base.
///
/// ```
/// use motor_hub::group::{BaseSettings, DriveBase};
///
/// let base = DriveBase { wheel_diameter_mm: 90.0, track_mm: 300.0, counts_per_turn: [1680.0, -1680.0] };
/// let settings = BaseSettings::new([0, 1], &base, true)?;
/// assert_eq!((settings.track_um, settings.counts_per_turn_thousandths[1]), (300_000, -1_680_000));
/// assert_eq!(settings.geometry(), base);
/// # Ok::<(), motor_hub::units::RangeError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BaseSettings {
    /// Motors of the left and the right wheel.
    pub wheels: [u8; 2],
    /// Diameter of both wheels in micrometres, 1 mm to 10 m.
    pub wheel_diameter_um: u32,
    /// Distance between the centres of the wheels in micrometres, 1 mm to 10 m.
    pub track_um: u32,
    /// Encoder counts per turn of the left and of the right wheel, in 1/1000, at least a count. Negative for a motor
    /// that counts down while its wheel drives forward.
    pub counts_per_turn_thousandths: [i32; 2],
    /// True if the base holds the heading of a gyro.
    pub use_gyro: bool,
}

impl BaseSettings {
    /// Allowed lengths in micrometres.
    pub const LENGTHS_UM: RangeInclusive<u32> = 1_000..=10_000_000;
    /// Smallest magnitude of the counts per turn, in 1/1000.
    pub const LEAST_COUNTS_THOUSANDTHS: u32 = 1_000;

    /// Rounds the dimensions of a base.
    ///
    /// # Errors
    /// [`RangeError::DriveBase`] if both wheels have the same motor, or if a dimension is out of range.
    pub fn new(wheels: [u8; 2], base: &DriveBase, use_gyro: bool) -> Result<Self, RangeError> {
        let [left, right] = wheels;
        if left == right {
            return Err(RangeError::DriveBase);
        }
        let length = |mm: f64| {
            let um = nearest(1e3 * mm).and_then(|um| u32::try_from(um).ok());
            um.filter(|um| Self::LENGTHS_UM.contains(um)).ok_or(RangeError::DriveBase)
        };
        let counts = |counts: f64| {
            let thousandths = nearest(1e3 * counts).and_then(|counts| i32::try_from(counts).ok());
            let least = Self::LEAST_COUNTS_THOUSANDTHS;
            thousandths.filter(|counts| counts.unsigned_abs() >= least).ok_or(RangeError::DriveBase)
        };
        let [left, right] = base.counts_per_turn;
        Ok(Self {
            wheels,
            wheel_diameter_um: length(base.wheel_diameter_mm)?,
            track_um: length(base.track_mm)?,
            counts_per_turn_thousandths: [counts(left)?, counts(right)?],
            use_gyro,
        })
    }

    /// Returns the dimensions.
    pub fn geometry(&self) -> DriveBase {
        DriveBase {
            wheel_diameter_mm: f64::from(self.wheel_diameter_um) / 1e3,
            track_mm: f64::from(self.track_um) / 1e3,
            counts_per_turn: self.counts_per_turn_thousandths.map(|counts| f64::from(counts) / 1e3),
        }
    }
}

/// Rounds to a whole number of counts; `None` beyond +-(2^31 - 1) and for NaN.
const fn to_i32(counts: f64) -> Option<i32> {
    match nearest(counts) {
        Some(counts) if counts.unsigned_abs() <= i32::MAX as u64 => Some(counts as i32),
        _ => None,
    }
}
