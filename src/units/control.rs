//! What the loops ask for and what a bridge is told: control values, duties, loop coefficients.

use fixed::types::{I16F16, U1F15};

/// The PID loop's control value: -32767 to 32767, positive for CW.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Control(i16);

impl Control {
    /// No effort.
    pub const ZERO: Self = Self(0);
    /// The positive end of the range, `controlMax` in the paper.
    pub const MAX: Self = Self(i16::MAX);
    /// The negative end of the range.
    pub const MIN: Self = Self(-i16::MAX);

    /// A control value; -32768 becomes -32767 so that the range is symmetric.
    pub const fn new(value: i16) -> Self {
        if value == i16::MIN { Self::MIN } else { Self(value) }
    }

    /// Clamps to the range.
    pub const fn saturating(value: i64) -> Self {
        if value > Self::MAX.0 as i64 {
            Self::MAX
        } else if value < Self::MIN.0 as i64 {
            Self::MIN
        } else {
            Self(value as i16)
        }
    }

    /// -32767 to 32767.
    pub const fn get(self) -> i16 {
        self.0
    }

    /// The same the other way.
    #[must_use]
    pub const fn reversed(self) -> Self {
        // In range: -32768 is not a value of this type.
        Self(-self.0)
    }
}

impl core::ops::Neg for Control {
    type Output = Self;
    fn neg(self) -> Self {
        self.reversed()
    }
}

/// Share of a PWM period, 0 to 1 in steps of 2^-15. Both ends are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Duty(U1F15);

impl Duty {
    /// Never.
    pub const ZERO: Self = Self(U1F15::ZERO);
    /// Always.
    pub const ONE: Self = Self(U1F15::ONE);

    /// From steps of 2^-15; more than 32768 becomes 1.
    pub const fn from_bits(bits: u16) -> Self {
        if bits > Self::ONE.0.to_bits() { Self::ONE } else { Self(U1F15::from_bits(bits)) }
    }

    /// `part / whole`, rounded to nearest; 0 if `part <= 0` or `whole <= 0`, 1 if `part >= whole`.
    ///
    /// `part` and `whole` may be anything below 2^47.
    pub const fn ratio(part: i64, whole: i64) -> Self {
        if part <= 0 || whole <= 0 {
            Self::ZERO
        } else if part >= whole {
            Self::ONE
        } else {
            Self::from_bits((((part << 15) + whole / 2) / whole) as u16)
        }
    }

    /// Steps of 2^-15, 0 to 32768.
    pub const fn to_bits(self) -> u16 {
        self.0.to_bits()
    }

    /// Timer compare value for a period of `period` ticks, rounded to nearest: 0 to `period`.
    pub const fn of_period(self, period: u16) -> u16 {
        ((self.0.to_bits() as u32 * period as u32 + (1 << 14)) >> 15) as u16
    }

    /// 0.0 to 1.0, exactly.
    pub const fn to_f32(self) -> f32 {
        self.0.to_bits() as f32 / 32_768.0
    }

    /// 0.0 to 1.0, for plots and models.
    pub fn to_f64(self) -> f64 {
        f64::from(self.0)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Duty {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}/32768", self.to_bits());
    }
}

/// How much of something, 0 to 1 in steps of 2^-15. Both ends are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Share(u16);

impl Share {
    /// Nothing.
    pub const NONE: Self = Self(0);
    /// The least that is something.
    pub const LEAST: Self = Self(1);
    /// All.
    pub const ALL: Self = Self(1 << 15);

    /// The nearest; what is less than 0 or no number is 0, what is more than 1 is 1.
    pub const fn from_f32(share: f32) -> Self {
        if share >= 1.0 { Self::ALL } else { Self((32_768.0 * share + 0.5) as u16) }
    }

    /// Steps of 2^-15, 0 to 32 768.
    pub const fn to_bits(self) -> u16 {
        self.0
    }

    /// 0.0 to 1.0, exactly.
    pub const fn to_f32(self) -> f32 {
        self.0 as f32 / 32_768.0
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Share {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}/32768", self.to_bits());
    }
}

/// A PIDF coefficient, signed Q16.16 as hosts send it: -32 768 to 32 767.99998.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coefficient(I16F16);

impl Coefficient {
    /// No contribution.
    pub const ZERO: Self = Self(I16F16::ZERO);

    /// From Q16.16 bits. All are in range; that a negative one does what its owner wants is for the
    /// owner to know.
    pub const fn from_bits(bits: i32) -> Self {
        Self(I16F16::from_bits(bits))
    }

    /// Q16.16 bits.
    pub const fn to_bits(self) -> i32 {
        self.0.to_bits()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Coefficient {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}/65536", self.to_bits());
    }
}
