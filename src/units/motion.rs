//! Speed in encoder counts per second.

use super::{RangeError, nearest};
use fixed::types::I24F8;

/// Encoder speed in counts per second: +-8 388 607, in steps of 1/256. Positive is CW.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CountsPerSecond(I24F8);

impl CountsPerSecond {
    /// Standstill: 0 counts per second.
    pub const ZERO: Self = Self(I24F8::ZERO);
    /// The largest speed of this type.
    pub const MAX: Self = Self(I24F8::MAX);

    /// Creates a speed from whole counts per second. Values beyond +-8 388 607 are limited to the range.
    pub const fn new(cps: i32) -> Self {
        Self::saturating_from_bits((cps as i64) << 8)
    }

    /// Converts revolutions per minute of a shaft to a speed, rounded to the nearest step.
    ///
    /// Both arguments are for the same shaft. For a geared motor that is either the motor shaft or the output shaft.
    ///
    /// ```
    /// # use motor_hub::units::{CountsPerSecond, constant};
    /// // The output shaft of a NeveRest 60 has 1680 counts per revolution.
    /// const SPEED: CountsPerSecond = constant!(CountsPerSecond::from_rpm(60.0, 1680.0));
    /// assert_eq!(SPEED, CountsPerSecond::new(1680));
    /// ```
    ///
    /// # Errors
    /// Returns [`RangeError::Speed`] if the speed is out of range or `counts_per_revolution` is not above 0.
    pub const fn from_rpm(rpm: f64, counts_per_revolution: f64) -> Result<Self, RangeError> {
        match nearest(rpm / 60.0 * counts_per_revolution * 256.0) {
            Some(bits) if counts_per_revolution > 0.0 && bits.unsigned_abs() <= i32::MAX as u64 => {
                Ok(Self::from_bits(bits as i32))
            }
            _ => Err(RangeError::Speed),
        }
    }

    /// Creates a speed from steps of 1/256 count per second. The range is symmetric: `i32::MIN` is limited to
    /// `-i32::MAX`.
    pub const fn from_bits(bits: i32) -> Self {
        Self(I24F8::from_bits(if bits == i32::MIN { -i32::MAX } else { bits }))
    }

    /// Creates a speed from steps of 1/256 count per second. Values beyond +-(2^31 - 1) steps are limited to the range.
    pub const fn saturating_from_bits(bits: i64) -> Self {
        const MAX: i64 = i32::MAX as i64;
        Self::from_bits(if bits > MAX {
            i32::MAX
        } else if bits < -MAX {
            -i32::MAX
        } else {
            bits as i32
        })
    }

    /// Returns the speed in steps of 1/256 count per second.
    pub const fn to_bits(self) -> i32 {
        self.0.to_bits()
    }

    /// Returns the speed rounded to whole counts per second.
    pub fn round(self) -> i32 {
        self.0.saturating_add(I24F8::from_bits(1 << 7)).to_num()
    }

    /// Returns the speed rounded to whole counts per second and limited to 16 bits.
    pub fn round_to_i16(self) -> i16 {
        self.round().clamp(i16::MIN.into(), i16::MAX.into()) as i16
    }

    /// Converts counts per second to a speed, rounded towards 0. Values beyond the range are limited; NaN becomes 0.
    pub const fn from_f32(counts_per_second: f32) -> Self {
        Self::from_bits((256.0 * counts_per_second) as i32)
    }

    /// Returns the speed in counts per second, rounded to the nearest `f32`.
    pub fn to_f32(self) -> f32 {
        self.to_bits() as f32 / 256.0
    }

    /// Returns the exact speed in counts per second, for plots and models.
    pub fn to_f64(self) -> f64 {
        f64::from(self.0)
    }
}

logged!(CountsPerSecond, "{} cps", round);
