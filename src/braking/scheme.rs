//! The schemes by which the four points are laid on the control range, chosen per motor.
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

/// How control values are given their meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Scheme {
    /// No braking regime: positive is 9/8 and negative 6/2 whichever way the motor turns. What the
    /// field's firmware did in 2018; here to be compared with.
    ForwardReverse,
    /// Control is an equivalent DC voltage (paper, section 2): T at 0, Z moves with the speed.
    A,
    /// Control is a current (paper, section 3): Z at 0, T moves with the speed.
    B,
    /// Scheme B without its knee at Z: braking as steep as driving, at the price of reverse authority
    /// and, above half of the free speed, of braking authority.
    C,
    /// Between B (blend 0) and C (blend 1).
    D(Blend),
}

impl Scheme {
    /// One of each kind; of D that which is half-way, and that which goes as far as it may.
    pub const EACH: [Self; 6] = [
        Self::ForwardReverse,
        Self::A,
        Self::B,
        Self::C,
        Self::D(Blend::Automatic),
        Self::D(Blend::Fixed(BlendFraction::HALF)),
    ];
}

/// How far Scheme D goes from B to C.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Blend {
    /// The same at all speeds.
    Fixed(BlendFraction),
    /// As far as leaves full dynamic braking within the control range.
    Automatic,
}

/// 0 to 1 in steps of 2^-16.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BlendFraction(u32);

impl BlendFraction {
    /// Scheme B.
    pub const ZERO: Self = Self(0);
    /// Half-way.
    pub const HALF: Self = Self(1 << 15);
    /// Scheme C.
    pub const ONE: Self = Self(1 << 16);

    /// From steps of 2^-16: 0 to 65 536.
    ///
    /// # Errors
    /// [`RangeError::Blend`] above.
    pub const fn from_bits(bits: u32) -> Result<Self, RangeError> {
        if bits <= Self::ONE.0 { Ok(Self(bits)) } else { Err(RangeError::Blend) }
    }

    /// Steps of 2^-16.
    pub const fn to_bits(self) -> u32 {
        self.0
    }
}
