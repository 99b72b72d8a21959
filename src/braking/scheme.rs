//! Schemes, which map control values to voltages. Each motor has its own.
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
    /// There is no braking regime: positive control values are 9/8 and negative ones 6/2, whatever the direction of
    /// motion. Firmware in the field did so in 2018. This scheme is for comparison.
    ForwardReverse,
    /// A control value is an equivalent DC voltage (paper, section 2): T is at 0, and Z moves with the speed.
    A,
    /// A control value is a current (paper, section 3): Z is at 0, and T moves with the speed.
    B,
    /// Scheme B without its knee at Z: braking is as steep as driving. Less reverse current is left within the
    /// control range, and above half of the free speed also less braking current.
    C,
    /// A blend between B (0) and C (1).
    D(Blend),
}

impl Scheme {
    /// One scheme of each kind, with D once automatic and once half-way.
    pub const EACH: [Self; 6] = [
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
    /// The blend is the largest that keeps full dynamic braking within the control range.
    Automatic,
}

/// Fraction of a blend: 0 (Scheme B) to 1 (Scheme C) in steps of 2^-16.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BlendFraction(u32);

impl BlendFraction {
    /// The blend is Scheme B.
    pub const ZERO: Self = Self(0);
    /// The blend is half-way between Schemes B and C.
    pub const HALF: Self = Self(1 << 15);
    /// The blend is Scheme C.
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
