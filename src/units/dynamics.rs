//! Response of a motor and its load to a voltage.

use super::{RangeError, nearest};
use fixed::types::{U16F16, U24F8};

/// Acceleration of a motor with its load, in counts/s² per volt of the difference between drive voltage and back EMF.
///
/// The range is above 0 and below 2^24 counts/s² per volt, in steps of 1/256. Gear motors without load have some 10³ to
/// 10⁴, and a motor with a heavy flywheel has some 10.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct AccelerationPerVolt(U24F8);

impl AccelerationPerVolt {
    /// Converts counts/s² per volt, rounded to the nearest step.
    ///
    /// # Errors
    /// Returns [`RangeError::AccelerationPerVolt`] if `value` is out of range.
    pub const fn from_f64(value: f64) -> Result<Self, RangeError> {
        match nearest(256.0 * value) {
            Some(bits) if 0 < bits && bits <= u32::MAX as i64 => Self::from_bits(bits as u32),
            _ => Err(RangeError::AccelerationPerVolt),
        }
    }

    /// Creates the value from steps of 1/256 counts/s² per volt.
    ///
    /// # Errors
    /// Returns [`RangeError::AccelerationPerVolt`] if `bits` is 0.
    pub const fn from_bits(bits: u32) -> Result<Self, RangeError> {
        if bits == 0 { Err(RangeError::AccelerationPerVolt) } else { Ok(Self(U24F8::from_bits(bits))) }
    }

    /// Returns the value in steps of 1/256 counts/s² per volt.
    pub const fn to_bits(self) -> u32 {
        self.0.to_bits()
    }

    /// Returns the value in counts/s² per volt, rounded to the nearest `f32`.
    pub const fn to_f32(self) -> f32 {
        self.to_bits() as f32 / 256.0
    }
}

/// Rate at which a motor at constant voltage approaches its steady speed, per second.
///
/// The rate is the inverse of the mechanical time constant, and results from back EMF and drag together. Its range is 0
/// to 65 535.99998 per second, in steps of 2^-16.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DecayRate(U16F16);

impl DecayRate {
    /// Converts a rate per second, rounded to the nearest step.
    ///
    /// # Errors
    /// Returns [`RangeError::DecayRate`] if `value` is out of range.
    pub const fn from_f64(value: f64) -> Result<Self, RangeError> {
        match nearest(65_536.0 * value) {
            Some(bits) if 0 <= bits && bits <= u32::MAX as i64 => Ok(Self::from_bits(bits as u32)),
            _ => Err(RangeError::DecayRate),
        }
    }

    /// Creates the rate from steps of 2^-16 per second.
    pub const fn from_bits(bits: u32) -> Self {
        Self(U16F16::from_bits(bits))
    }

    /// Returns the rate in steps of 2^-16 per second.
    pub const fn to_bits(self) -> u32 {
        self.0.to_bits()
    }

    /// Returns the rate per second, rounded to the nearest `f32`.
    pub const fn to_f32(self) -> f32 {
        self.to_bits() as f32 / 65_536.0
    }
}

/// An acceleration limit: 1 to 2^32 - 1 counts/s².
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Acceleration(core::num::NonZeroU32);

impl Acceleration {
    /// Creates a limit from whole counts/s².
    ///
    /// # Errors
    /// Returns [`RangeError::Acceleration`] if the limit is 0, because the motor could never move.
    pub const fn new(counts_per_second_squared: u32) -> Result<Self, RangeError> {
        match core::num::NonZeroU32::new(counts_per_second_squared) {
            Some(value) => Ok(Self(value)),
            None => Err(RangeError::Acceleration),
        }
    }

    /// Returns the limit in counts/s².
    pub const fn get(self) -> u32 {
        self.0.get()
    }
}

logged!(AccelerationPerVolt, "{} cps/s/V", to_f32);

logged!(DecayRate, "{}/s", to_f32);
