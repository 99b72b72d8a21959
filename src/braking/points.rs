//! The four points S, T, Z, G of the control range: where reverse driving, proportional braking and
//! forward driving begin and end at one speed and battery voltage.
//!
//! All formulas assume clockwise motion; [`super::place`] mirrors the rest. Everything is integer
//! arithmetic on exact ratios, so an abscissa is off by at most 1/512 count from the formula applied
//! to the same integers, however close |emf| comes to the battery voltage.

use crate::braking::scheme::{Blend, BlendFraction, Scheme};
use crate::units::{Control, Duty, Emf, Millivolts};
use fixed::types::I56F8;

/// The speed and the supply for which points are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OperatingPoint {
    emf: Emf,
    /// Above 0.
    battery: Millivolts,
}

impl OperatingPoint {
    /// `None` if the battery voltage is 0: nothing can be said about a bridge without supply.
    pub const fn new(emf: Emf, battery: Millivolts) -> Option<Self> {
        if battery.get() == 0 { None } else { Some(Self { emf, battery }) }
    }

    /// True if the motor turns counter-clockwise, so that control and modes are mirrored.
    pub const fn counter_clockwise(self) -> bool {
        self.emf.is_negative()
    }

    /// |emf| and battery voltage in steps of 2^-20 mV: below 2^37 and below 2^36.
    const fn fine(self) -> (i64, i64) {
        (self.emf.to_bits().abs(), (self.battery.get() as i64) << 20)
    }

    /// |emf| and battery voltage in 1/16 mV: at most 2^21 and below 2^20.
    pub(super) const fn sixteenths(self) -> (i32, i32) {
        (self.emf.eighths().abs() << 1, (self.battery.get() as i32) << 4)
    }

    /// True if the back EMF is at least the battery voltage: the battery can push no current.
    pub const fn is_overrun(self) -> bool {
        let (e, v) = self.fine();
        e >= v
    }
}

/// A control value that may lie outside the control range, in counts with 8 fractional bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Abscissa(I56F8);

impl Abscissa {
    const ZERO: Self = Self::from_bits(0);
    const CONTROL_MAX: Self = Self::from_bits((Control::MAX.get() as i64) << 8);
    const CONTROL_MIN: Self = Self::from_bits((Control::MIN.get() as i64) << 8);

    /// From 1/256 counts.
    pub const fn from_bits(bits: i64) -> Self {
        Self(I56F8::from_bits(bits))
    }

    /// The abscissa of a control value.
    pub const fn of(control: Control) -> Self {
        Self::from_bits((control.get() as i64) << 8)
    }

    const fn to_bits(self) -> i64 {
        self.0.to_bits()
    }

    /// Counts, for reports.
    pub fn to_f64(self) -> f64 {
        self.0.to_num()
    }
}

/// What a control value asks for, relative to the way the motor turns.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Regime {
    /// S to T: driven against the motion, 6/2 when turning CW.
    Reverse,
    /// T to Z: proportional braking, 5/0.
    Braking,
    /// Z to G: driven with the motion, 9/8 when turning CW.
    Forward,
}

/// A control value's place among the points: its regime, and how far into it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// The regime that the control value falls into.
    pub regime: Regime,
    /// 0 at the end of least torque (Z for forward and braking, T for reverse), 1 at the other end.
    pub fraction: Duty,
}

/// The abscissas of the four points for clockwise motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Points {
    /// 100 % reverse driving.
    pub s: Abscissa,
    /// 0 % reverse driving and 100 % proportional braking.
    pub t: Abscissa,
    /// 0 % proportional braking and 0 % forward driving.
    pub z: Abscissa,
    /// 100 % forward driving.
    pub g: Abscissa,
}

impl Points {
    /// The points that the firmware uses.
    ///
    /// Points beyond the control range stay there: with Scheme A in overrun every positive control
    /// value is braking. Schemes C and D say nothing in overrun (their T runs to minus infinity and
    /// comes back from plus infinity); there the blend is 0, which is Scheme B, and all of the
    /// braking is within reach.
    pub const fn new(scheme: Scheme, at: OperatingPoint) -> Self {
        let scheme = match scheme {
            Scheme::C | Scheme::D(_) if at.is_overrun() => Scheme::B,
            other => other,
        };
        match Self::from_formula(scheme, at) {
            Some(points) => points,
            // Only |emf| = battery has no value, and that is overrun.
            None => Self::on_line(Abscissa::ZERO, Abscissa::ZERO),
        }
    }

    /// The scheme's own formula, even where it means nothing (Schemes C and D in overrun).
    ///
    /// `None` where it is infinite: Schemes C and D with |emf| equal to the battery voltage.
    pub const fn from_formula(scheme: Scheme, at: OperatingPoint) -> Option<Self> {
        let (e, v) = at.fine();
        Some(match scheme {
            Scheme::ForwardReverse => Self::on_line(Abscissa::ZERO, Abscissa::ZERO),
            Scheme::A => Self::on_line(Abscissa::ZERO, scaled(e, v)),
            Scheme::B => Self::on_line(scaled(-e, v + e), Abscissa::ZERO),
            Scheme::C if e == v => return None,
            Scheme::C => Self {
                s: Abscissa::from_bits(Abscissa::CONTROL_MAX.to_bits() - scaled(2 * v, v - e).to_bits()),
                ..Self::on_line(scaled(e, e - v), Abscissa::ZERO)
            },
            Scheme::D(blend) => {
                let weight = match blend {
                    Blend::Fixed(fraction) => fraction,
                    Blend::Automatic => keeping_full_braking(e, v),
                };
                let (Some(b), Some(c)) =
                    (Self::from_formula(Scheme::B, at), Self::from_formula(Scheme::C, at))
                else {
                    return None;
                };
                Self { s: blended(b.s, c.s, weight), t: blended(b.t, c.t, weight), ..b }
            }
        })
    }

    /// S and G at the ends of the control range.
    const fn on_line(t: Abscissa, z: Abscissa) -> Self {
        Self { s: Abscissa::CONTROL_MIN, t, z, g: Abscissa::CONTROL_MAX }
    }

    /// Where a control value lies among the points (paper, section 1.3).
    ///
    /// Exactly at Z, and everywhere between coinciding T and Z, that is braking with fraction 0: the
    /// bridge is open. Exactly at T it is full braking.
    pub const fn place(&self, control: Control) -> Place {
        let c = Abscissa::of(control).to_bits();
        let (s, t) = (self.s.to_bits(), self.t.to_bits());
        let (z, g) = (self.z.to_bits(), self.g.to_bits());
        if c > z {
            Place { regime: Regime::Forward, fraction: Duty::ratio(c - z, g - z) }
        } else if c >= t {
            Place { regime: Regime::Braking, fraction: Duty::ratio(z - c, z - t) }
        } else {
            Place { regime: Regime::Reverse, fraction: Duty::ratio(t - c, t - s) }
        }
    }
}

/// Beyond this the ends of the control range say all there is to say; it keeps a blend in 64 bits.
const FAR: i64 = 1 << 45;

/// `controlMax * numerator / denominator`, rounded to 1/256 count.
///
/// |numerator| below 2^38, so the product stays below 2^61.
const fn scaled(numerator: i64, denominator: i64) -> Abscissa {
    let counts = div_round(Abscissa::CONTROL_MAX.to_bits() * numerator, denominator);
    Abscissa::from_bits(if counts > FAR {
        FAR
    } else if counts < -FAR {
        -FAR
    } else {
        counts
    })
}

/// `b + weight * (c - b)`: weight 0 is Scheme B, 1 is Scheme C.
const fn blended(b: Abscissa, c: Abscissa, weight: BlendFraction) -> Abscissa {
    let step = (c.to_bits() - b.to_bits()) * weight.to_bits() as i64;
    Abscissa::from_bits(b.to_bits() + div_round(step, BlendFraction::ONE.to_bits() as i64))
}

/// The largest blend that keeps full dynamic braking inside the control range:
/// `min(1, (1 - u) / (2 u^2))` with `u = |emf| / battery`.
const fn keeping_full_braking(e: i64, v: i64) -> BlendFraction {
    // 1/16 mV is fine enough for a weight in 1/65536, and lets squares fit in 64 bits. Rounded so
    // that the weight errs low: the braking must not fall out of the range.
    let (e, v) = ((e + 0xFFFF) >> 16, v >> 16);
    if e >= v {
        return BlendFraction::ZERO;
    }
    let (part, whole) = (v * (v - e), 2 * e * e);
    if part >= whole { BlendFraction::ONE } else { BlendFraction::saturating((part << 16) / whole) }
}

/// Nearest integer, halves away from zero. The denominator is not 0.
const fn div_round(numerator: i64, denominator: i64) -> i64 {
    let half = denominator.abs() / 2;
    let n = if numerator < 0 { numerator - half } else { numerator + half };
    n / denominator
}
