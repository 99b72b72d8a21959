//! Time since boot, and the control period.

use super::RangeError;

/// Time since boot in microseconds: 0 to 584 000 years.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Micros(u64);

impl Micros {
    /// So many microseconds since boot.
    pub const fn new(micros: u64) -> Self {
        Self(micros)
    }

    /// Microseconds since boot.
    pub const fn get(self) -> u64 {
        self.0
    }

    /// Microseconds from `earlier` to this, 0 if `earlier` is later.
    pub const fn since(self, earlier: Self) -> u64 {
        self.0.saturating_sub(earlier.0)
    }
}

/// The control period: 1 to 100 ms, 50 by default as in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Period(u8);

impl Period {
    /// 50 ms, the FTC firmware's interval (paper, section 1.3).
    pub const DEFAULT: Self = Self(50);

    /// A period of `ms` milliseconds.
    ///
    /// # Errors
    /// [`RangeError::Period`] unless 1 to 100.
    pub const fn from_millis(ms: u32) -> Result<Self, RangeError> {
        if ms >= 1 && ms <= 100 { Ok(Self(ms as u8)) } else { Err(RangeError::Period) }
    }

    /// 1 to 100.
    pub const fn as_millis(self) -> u32 {
        self.0 as u32
    }

    /// 0.001 to 0.1, to the nearest single.
    pub const fn to_seconds(self) -> f32 {
        self.as_millis() as f32 / 1000.0
    }

    /// 1000 to 100 000.
    pub const fn as_micros(self) -> u64 {
        self.0 as u64 * 1000
    }
}

impl Default for Period {
    fn default() -> Self {
        Self::DEFAULT
    }
}
