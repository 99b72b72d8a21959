//! The schemes by which the four points are laid on the control range, chosen per motor.

use super::explog::ratio_q20;
use crate::units::{Control, RangeError};

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
    /// The current that a control value asks for, times the resistance between the battery's
    /// terminals, as CW motion sees it; `None` if the scheme gives control another meaning.
    ///
    /// `e` (|emf|) below 2^21, `v` (battery) below 2^20, result below 2^22, all in 1/16 mV. It never
    /// falls as control rises: in overrun, where the battery cannot push, Schemes B to D let the motor
    /// coast at positive control values.
    pub(super) const fn current(self, e: i32, v: i32, control: Control) -> Option<i32> {
        let push = if v > e { v - e } else { 0 };
        let pull = match self {
            Self::ForwardReverse => return None,
            Self::A => return Some(of_range(control, v) - e),
            Self::B => v + e,
            Self::C | Self::D(_) if push == 0 => v + e,
            Self::C => push,
            // b = 1 up to half of the battery voltage; above, T stays at the end of the range.
            Self::D(Blend::Automatic) => {
                if e > push {
                    e
                } else {
                    push
                }
            }
            // (V + e) / (1 + b ((V + e) / (V - e) - 1)) = (V + e) (V - e) / (V - e + 2 b e)
            Self::D(Blend::Fixed(blend)) => {
                let knee = ((e as i64 * blend.0 as i64) >> 15) as i32;
                let ratio = ratio_q20(push as u32, (push + knee) as u32);
                (((v + e) as i64 * ratio as i64) >> 20) as i32
            }
        };
        Some(of_range(control, if control.get() > 0 { push } else { pull }))
    }
}

/// `control / controlMax * voltage`, rounded; `voltage` from 0 to 2^22.
const fn of_range(control: Control, voltage: i32) -> i32 {
    let product = control.get() as i64 * voltage as i64;
    // 1 / 32767 is 1 / 32768 and its 32768th part more.
    ((product + (product >> 15) + (1 << 14)) >> 15) as i32
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

    pub(super) const fn saturating(bits: i64) -> Self {
        if bits <= 0 {
            Self::ZERO
        } else if bits >= Self::ONE.0 as i64 {
            Self::ONE
        } else {
            Self(bits as u32)
        }
    }
}
