//! Control values, duties and coefficients of the control loops.

use fixed::types::{I16F16, U1F15};

/// A control value: -32767 to 32767, positive for CW. The scheme of a motor says what a control value means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Control(i16);

impl Control {
    /// The control value 0.
    pub const ZERO: Self = Self(0);
    /// The positive end of the range. R. Atkinson, *On Proportional Braking in H Bridges* (2018), calls it
    /// `controlMax`.
    pub const MAX: Self = Self(i16::MAX);
    /// The negative end of the range.
    pub const MIN: Self = Self(-i16::MAX);

    /// Creates a control value. -32768 becomes -32767, so that the range is symmetric.
    pub const fn new(value: i16) -> Self {
        if value == i16::MIN { Self::MIN } else { Self(value) }
    }

    /// Creates a control value from any number. Numbers out of range are limited to the range.
    pub const fn saturating(value: i64) -> Self {
        if value > Self::MAX.0 as i64 {
            Self::MAX
        } else if value < Self::MIN.0 as i64 {
            Self::MIN
        } else {
            Self(value as i16)
        }
    }

    /// Returns the control value, -32767 to 32767.
    pub const fn get(self) -> i16 {
        self.0
    }

    /// Returns the control value divided by 32767: -1.0 to 1.0, for plots and reports.
    pub fn to_f64(self) -> f64 {
        f64::from(self.0) / f64::from(Self::MAX.0)
    }

    /// Returns the control value of the same size in the opposite direction.
    #[must_use]
    pub const fn reversed(self) -> Self {
        // The result is in range, because -32768 is not a value of this type.
        Self(-self.0)
    }
}

/// The on-time of a PWM signal as a share of its period: 0 to 1, in steps of 2^-15. Both ends are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Duty(U1F15);

impl Duty {
    /// Duty 0: the signal is never on.
    pub const ZERO: Self = Self(U1F15::ZERO);
    /// Duty 1: the signal is always on.
    pub const ONE: Self = Self(U1F15::ONE);

    /// Creates a duty from steps of 2^-15. More than 32768 steps become 1.
    pub const fn from_bits(bits: u16) -> Self {
        if bits > Self::ONE.0.to_bits() { Self::ONE } else { Self(U1F15::from_bits(bits)) }
    }

    /// Returns `part / whole`, rounded to the nearest step and limited to 0 to 1. The result is 0 if `whole` is not
    /// above 0.
    ///
    /// `part` and `whole` must be below 2^47.
    pub const fn ratio(part: i64, whole: i64) -> Self {
        if part <= 0 || whole <= 0 {
            Self::ZERO
        } else if part >= whole {
            Self::ONE
        } else {
            Self::from_bits((((part << 15) + whole / 2) / whole) as u16)
        }
    }

    /// Returns the duty in steps of 2^-15, 0 to 32768.
    pub const fn to_bits(self) -> u16 {
        self.0.to_bits()
    }

    /// Returns the compare value for a timer with a period of `period` ticks, rounded to nearest: 0 to `period`.
    pub const fn of_period(self, period: u16) -> u16 {
        ((self.0.to_bits() as u32 * period as u32 + (1 << 14)) >> 15) as u16
    }

    /// Returns the exact duty, 0.0 to 1.0.
    pub const fn to_f32(self) -> f32 {
        self.0.to_bits() as f32 / 32_768.0
    }

    /// Returns the exact duty, 0.0 to 1.0, for plots and models.
    pub fn to_f64(self) -> f64 {
        f64::from(self.0)
    }
}

logged!(Duty, "{}/32768", to_bits);

/// A fraction of a whole: 0 to 1, in steps of 2^-15. Both ends are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Share(u16);

impl Share {
    /// The fraction 0.
    pub const NONE: Self = Self(0);
    /// The smallest fraction above 0: one step.
    pub const LEAST: Self = Self(1);
    /// The fraction 1.
    pub const ALL: Self = Self(1 << 15);

    /// Converts a fraction, rounded to the nearest step. Values below 0 and NaN become 0; values above 1 become 1.
    pub const fn from_f32(share: f32) -> Self {
        if share >= 1.0 { Self::ALL } else { Self((32_768.0 * share + 0.5) as u16) }
    }

    /// Returns the fraction in steps of 2^-15, 0 to 32 768.
    pub const fn to_bits(self) -> u16 {
        self.0
    }

    /// Returns the exact fraction, 0.0 to 1.0.
    pub const fn to_f32(self) -> f32 {
        self.0 as f32 / 32_768.0
    }
}

logged!(Share, "{}/32768", to_bits);

/// A coefficient of a PIDF controller, -32 768 to 32 767.99998. The format is signed Q16.16, as hosts send it: 32 bits
/// in steps of 2^-16.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coefficient(I16F16);

impl Coefficient {
    /// The coefficient 0: its term contributes nothing.
    pub const ZERO: Self = Self(I16F16::ZERO);

    /// Creates a coefficient from Q16.16 bits. All bits are valid, so the coefficient may be negative.
    pub const fn from_bits(bits: i32) -> Self {
        Self(I16F16::from_bits(bits))
    }

    /// Returns the Q16.16 bits.
    pub const fn to_bits(self) -> i32 {
        self.0.to_bits()
    }
}

logged!(Coefficient, "{}/65536", to_bits);
