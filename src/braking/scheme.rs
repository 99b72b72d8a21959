//! Schemes, which map control values to voltages. The scheme is a setting of each motor.
//!
//! ```
//! use motor_hub::braking::{Blend, BlendFraction, Scheme};
//!
//! let a_quarter = BlendFraction::from_bits(1 << 14)?;
//! let scheme = Scheme::D(Blend::Fixed(a_quarter));
//! assert_ne!(scheme, Scheme::D(Blend::Automatic));
//! assert!(BlendFraction::from_bits((1 << 16) + 1).is_err());
//! # Ok::<(), motor_hub::units::RangeError>(())
//! ```

use crate::units::RangeError;

/// Map from control values to voltages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Scheme {
    /// Positive control values use mode 9/8 and negative control values mode 6/2, in both directions of motion. There
    /// is no braking regime. Hub firmware of 2018 worked in this way; the scheme is here for comparison.
    ForwardReverse,
    /// A control value is proportional to an equivalent DC voltage (paper, section 2). T is at 0, and Z moves with the
    /// speed.
    A,
    /// A control value is proportional to a current, with one factor for forward driving and another one for braking
    /// and reverse (paper, section 3). Z is at 0, and T moves with the speed.
    B,
    /// Scheme B with the same factor for braking as for forward driving, so that the current has no knee at Z. T and S
    /// lie lower than in Scheme B, so the control range ends at less reverse current. While the back EMF is between
    /// half of the battery voltage and the battery voltage, the control range ends before full braking.
    C,
    /// A blend of the points of Schemes B (blend 0) and C (blend 1).
    D(Blend),
}

impl Scheme {
    /// Every scheme. Scheme D is listed twice: with the automatic blend, and with the fixed blend 1/2.
    pub const ALL: [Self; 6] = [
        Self::ForwardReverse,
        Self::A,
        Self::B,
        Self::C,
        Self::D(Blend::Automatic),
        Self::D(Blend::Fixed(BlendFraction::HALF)),
    ];
}

/// Blend of Scheme D between B and C.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Blend {
    /// The blend is the same at all speeds.
    Fixed(BlendFraction),
    /// The blend follows the speed: the largest blend that keeps full dynamic braking within the control range.
    Automatic,
}

/// Fraction of a blend: 0 (Scheme B) to 1 (Scheme C) in steps of 2^-16.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BlendFraction(u32);

impl BlendFraction {
    /// Blend 0: Scheme B alone.
    pub const ZERO: Self = Self(0);
    /// Blend 1/2: midway between Schemes B and C.
    pub const HALF: Self = Self(1 << 15);
    /// Blend 1: Scheme C alone.
    pub const ONE: Self = Self(1 << 16);

    /// Converts from steps of 2^-16: 0 to 65 536.
    ///
    /// # Errors
    /// Fails with [`RangeError::Blend`] for more than 65 536 steps.
    pub const fn from_bits(bits: u32) -> Result<Self, RangeError> {
        if bits <= Self::ONE.0 { Ok(Self(bits)) } else { Err(RangeError::Blend) }
    }

    /// The blend in steps of 2^-16.
    pub const fn to_bits(self) -> u32 {
        self.0
    }
}
