//! The time since boot and the control period.

use super::RangeError;

/// Time since boot in microseconds: 0 to 584 000 years.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Micros(u64);

impl Micros {
    /// Creates a time from microseconds since boot.
    pub const fn new(micros: u64) -> Self {
        Self(micros)
    }

    /// Returns the microseconds since boot.
    pub const fn get(self) -> u64 {
        self.0
    }

    /// Returns the microseconds from `earlier` to `self`; 0 if `earlier` is after `self`.
    pub const fn since(self, earlier: Self) -> u64 {
        self.0.saturating_sub(earlier.0)
    }
}

/// The control period: 1 to 100 ms. The default is 50 ms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Period(u8);

impl Period {
    /// The default period of 50 ms: the control interval of the hub firmware of FIRST Tech Challenge (R. Atkinson, *On
    /// Proportional Braking in H Bridges*, 2018, section 1.3).
    pub const DEFAULT: Self = Self(50);

    /// Creates a period from milliseconds.
    ///
    /// # Errors
    /// Returns [`RangeError::Period`] if `ms` is not 1 to 100.
    pub const fn from_millis(ms: u32) -> Result<Self, RangeError> {
        if ms >= 1 && ms <= 100 { Ok(Self(ms as u8)) } else { Err(RangeError::Period) }
    }

    /// Returns the period in milliseconds, 1 to 100.
    pub const fn as_millis(self) -> u32 {
        self.0 as u32
    }

    /// Returns the period in seconds, 0.001 to 0.1, rounded to the nearest `f32`.
    pub const fn to_seconds(self) -> f32 {
        self.as_millis() as f32 / 1000.0
    }

    /// Returns the period in microseconds, 1000 to 100 000.
    pub const fn as_micros(self) -> u64 {
        self.0 as u64 * 1000
    }
}

impl Default for Period {
    fn default() -> Self {
        Self::DEFAULT
    }
}
