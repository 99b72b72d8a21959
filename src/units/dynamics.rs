//! How a motor and its load answer to a voltage.

use super::{RangeError, nearest};
use fixed::types::{U16F16, U24F8};

/// Acceleration of a motor with its load for each volt beyond its back EMF, in counts/s² per volt: 1/256 to
/// 16 777 215, in steps of 1/256. A bare gear motor has some 10³ to 10⁴; a heavy flywheel makes it 10.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct AccelerationPerVolt(U24F8);

impl AccelerationPerVolt {
    /// From counts/s² per volt, rounded to the nearest step.
    ///
    /// # Errors
    /// [`RangeError::AccelerationPerVolt`] outside of this type's range.
    pub const fn from_f64(value: f64) -> Result<Self, RangeError> {
        match nearest(256.0 * value) {
            Some(bits) if 0 < bits && bits <= u32::MAX as i64 => Self::from_bits(bits as u32),
            _ => Err(RangeError::AccelerationPerVolt),
        }
    }

    /// From steps of 1/256.
    ///
    /// # Errors
    /// [`RangeError::AccelerationPerVolt`] if 0.
    pub const fn from_bits(bits: u32) -> Result<Self, RangeError> {
        if bits == 0 { Err(RangeError::AccelerationPerVolt) } else { Ok(Self(U24F8::from_bits(bits))) }
    }

    /// Steps of 1/256.
    pub const fn to_bits(self) -> u32 {
        self.0.to_bits()
    }

    /// Counts/s² per volt.
    pub const fn to_f32(self) -> f32 {
        self.to_bits() as f32 / 256.0
    }
}

/// How fast the speed of a motor left at a constant voltage approaches its end: the inverse of the mechanical time
/// constant, from back EMF and drag together. 0 to 65 535.99998 per second, in steps of 2^-16.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct DecayRate(U16F16);

impl DecayRate {
    /// From 1/s, rounded to the nearest step.
    ///
    /// # Errors
    /// [`RangeError::DecayRate`] outside of this type's range.
    pub const fn from_f64(value: f64) -> Result<Self, RangeError> {
        match nearest(65_536.0 * value) {
            Some(bits) if 0 <= bits && bits <= u32::MAX as i64 => Ok(Self::from_bits(bits as u32)),
            _ => Err(RangeError::DecayRate),
        }
    }

    /// From steps of 2^-16 per second.
    pub const fn from_bits(bits: u32) -> Self {
        Self(U16F16::from_bits(bits))
    }

    /// Steps of 2^-16 per second.
    pub const fn to_bits(self) -> u32 {
        self.0.to_bits()
    }

    /// 1/s.
    pub const fn to_f32(self) -> f32 {
        self.to_bits() as f32 / 65_536.0
    }
}

/// A limit of acceleration: 1 to 2^32 - 1 counts/s².
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Acceleration(core::num::NonZeroU32);

impl Acceleration {
    /// Whole counts/s².
    ///
    /// # Errors
    /// [`RangeError::Acceleration`] if 0: nothing could ever move.
    pub const fn new(counts_per_second_squared: u32) -> Result<Self, RangeError> {
        match core::num::NonZeroU32::new(counts_per_second_squared) {
            Some(value) => Ok(Self(value)),
            None => Err(RangeError::Acceleration),
        }
    }

    /// Counts/s².
    pub const fn get(self) -> u32 {
        self.0.get()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for AccelerationPerVolt {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{} cps/s/V", self.to_f32());
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for DecayRate {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}/s", self.to_f32());
    }
}
