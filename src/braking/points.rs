//! The four points S, T, Z and G: the control values at which reverse driving, proportional braking and forward driving
//! begin and end. The points depend on the speed, the battery voltage, and the [`Scheme`] that divides the control
//! range among the three. A point may lie outside the control range.
//!
//! ```text
//!   S ---- reverse, 6/2 ---- T ---- braking, 5/0 ---- Z ---- forward, 9/8 ---- G
//! ```
//!
//! 6/2, 5/0 and 9/8 are the paper's names of switching modes: the states of the bridge, as numbers of four bits, in the
//! on part and in the off part of a PWM period (see [`Mode`]). *The paper* is R. Atkinson, *On Proportional Braking in
//! H Bridges*, 2018.
//!
//! All formulas assume clockwise motion. The [modulator](super::Modulator) mirrors counter-clockwise motion. Points are
//! computed in integers. A *control step* is a difference of 1 between control values. A point that is computed from
//! the back EMF e and the battery voltage V has an error below 1/512 control step. A point that is computed from other
//! points, such as a blend, has an error below 1/100 control step.
//!
//! ```
//! use motor_hub::braking::{OperatingPoint, Points, Regime, Scheme, Winding};
//! use motor_hub::units::{Control, CountsPerSecond, Millivolts};
//!
//! // A NeveRest 60 at half of its free speed on 12 V, Scheme A: Z is midway between T and G.
//! let emf = Winding::NEVEREST_60.emf.emf(CountsPerSecond::new(1505));
//! let at = OperatingPoint::new(emf, Millivolts::new(12_000)).expect("there is a battery");
//! let points = Points::new(Scheme::A, at);
//! assert_eq!((points.t.to_f64(), points.z.to_f64().round()), (0.0, 16_384.0));
//! assert_eq!(points.locate(Control::new(8_000)).regime, Regime::Braking);
//! ```

use crate::braking::scheme::{Blend, BlendFraction, Scheme};
use crate::bridge::{Drive, Mode};
use crate::units::single::at_most;
use crate::units::{Control, Duty, Emf, Millivolts};
use fixed::types::{I56F8, U2F30};
use libm::roundf;

/// Back EMF and battery voltage for which points are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct OperatingPoint {
    /// |emf| in units of 2^-20 mV: below 2^37.
    e: i64,
    /// Battery voltage, above 0.
    battery: Millivolts,
    /// True if the back EMF is negative, so that the motor turns counter-clockwise.
    counter_clockwise: bool,
}

impl OperatingPoint {
    /// Creates an operating point. `None` if the battery voltage is 0, because the points are ratios to this voltage.
    pub const fn new(emf: Emf, battery: Millivolts) -> Option<Self> {
        if battery.get() == 0 {
            return None;
        }
        let emf = emf.to_bits();
        Some(Self { e: emf.abs(), battery, counter_clockwise: emf < 0 })
    }

    /// Battery voltage in units of 2^-20 mV: above 0, below 2^36.
    const fn v(self) -> i64 {
        (self.battery.get() as i64) << 20
    }

    /// True if the motor turns counter-clockwise, so that control and modes are mirrored.
    pub const fn counter_clockwise(self) -> bool {
        self.counter_clockwise
    }

    /// The command with the mode of a regime.
    pub const fn drive(self, regime: Regime, duty: Duty) -> Drive {
        Drive { mode: regime.mode(self.counter_clockwise), duty }
    }

    /// Full reverse: the bridge drives against the motion with duty 1. In volts this is the point S of every scheme.
    pub const fn full_reverse(self) -> Drive {
        self.drive(Regime::Reverse, Duty::ONE)
    }

    /// Regime of a command: the inverse of [`Regime::mode`].
    pub const fn regime(self, drive: Drive) -> Regime {
        let for_clockwise = if self.counter_clockwise { drive.mode.mirrored() } else { drive.mode };
        match for_clockwise {
            Mode::Cw98 => Regime::Forward,
            Mode::Brake50 => Regime::Braking,
            Mode::Ccw62 => Regime::Reverse,
        }
    }

    /// |emf| and battery voltage in volts, with a resolution of 1/16 mV: below 132 V and 66 V.
    pub(crate) const fn volts(self) -> (f32, f32) {
        (volts_of(self.e), self.battery_volts())
    }

    /// Back EMF in volts; positive for a motor that turns CW.
    pub(crate) const fn emf_volts(self) -> f32 {
        let e = volts_of(self.e);
        if self.counter_clockwise { -e } else { e }
    }

    /// Battery voltage in volts.
    pub(crate) const fn battery_volts(self) -> f32 {
        self.battery.to_volts()
    }

    /// True if the back EMF is at least the battery voltage: the battery drives no current in the direction of motion.
    pub const fn is_overrun(self) -> bool {
        self.e >= self.v()
    }
}

/// Converts units of 2^-20 mV to volts. The voltage is first rounded down to units of 1/16 mV, whose number is at most
/// 2^21, and an `f32` holds this number exactly. So only the division to volts rounds.
const fn volts_of(bits: i64) -> f32 {
    (bits >> 16) as i32 as f32 / 16_000.0
}

/// A control value that may lie outside the control range, with a resolution of 1/256.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct UnboundedControl(I56F8);

impl UnboundedControl {
    const ZERO: Self = Self::from_computed_bits(0);
    /// Upper end of the control range.
    const CONTROL_MAX: Self = Self::from_computed_bits((Control::MAX.get() as i64) << 8);
    /// Lower end of the control range.
    const CONTROL_MIN: Self = Self::from_computed_bits((Control::MIN.get() as i64) << 8);

    /// Converts from 1/256 control steps. Values beyond +-2^45 are limited to this range, which is 4 million times the
    /// control range.
    pub const fn from_bits(bits: i64) -> Self {
        Self::from_computed_bits(if bits > POINT_LIMIT_BITS {
            POINT_LIMIT_BITS
        } else if bits < -POINT_LIMIT_BITS {
            -POINT_LIMIT_BITS
        } else {
            bits
        })
    }

    /// Converts computed 1/256 control steps, whose magnitude is at most `POINT_LIMIT_BITS` and one control range.
    const fn from_computed_bits(bits: i64) -> Self {
        Self(I56F8::from_bits(bits))
    }

    /// Converts a control value.
    pub const fn of(control: Control) -> Self {
        Self::from_computed_bits((control.get() as i64) << 8)
    }

    /// The value in 1/256 control steps.
    const fn to_bits(self) -> i64 {
        self.0.to_bits()
    }

    /// Control steps in single precision, limited to 2^22, far beyond the control range.
    fn to_f32(self) -> f32 {
        const LIMIT_BITS: i64 = 1 << 30;
        self.to_bits().clamp(-LIMIT_BITS, LIMIT_BITS) as i32 as f32 / 256.0
    }

    /// The nearest control step.
    pub const fn round(self) -> i64 {
        (self.to_bits() + 128) >> 8
    }

    /// Control steps, in double precision for reports.
    pub fn to_f64(self) -> f64 {
        self.0.to_num()
    }
}

/// Regime of a control value or voltage, relative to the direction of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Regime {
    /// From S to T the motor is driven against its motion: 6/2 for CW motion.
    Reverse,
    /// From T to Z the motor brakes in proportion: 5/0.
    Braking,
    /// From Z to G the motor is driven with its motion: 9/8 for CW motion.
    Forward,
}

impl Regime {
    /// The name of the regime for users.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Reverse => "reverse",
            Self::Braking => "braking",
            Self::Forward => "forward",
        }
    }

    /// The switching mode of the regime. For CCW motion 9/8 and 6/2 are exchanged.
    pub const fn mode(self, counter_clockwise: bool) -> Mode {
        let clockwise = match self {
            Self::Forward => Mode::Cw98,
            Self::Braking => Mode::Brake50,
            Self::Reverse => Mode::Ccw62,
        };
        if counter_clockwise { clockwise.mirrored() } else { clockwise }
    }
}

/// Location of a control value among the points: its regime, and the fraction of the regime.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Location {
    /// Regime of the control value.
    pub regime: Regime,
    /// Fraction of the regime: 0 at the regime's end with the least torque (Z for forward and braking, T for reverse),
    /// 1 at the other end.
    pub fraction: Fraction,
}

impl Location {
    /// The mean current that this location requests, as the voltage `w` of [`mod@super::linear_current`]: current times
    /// the resistance of winding and switches, in V, positive in the regime's direction. Full forward is `V - e`, full
    /// braking `e`, full reverse `V + e`.
    pub(super) const fn current(self, at: OperatingPoint) -> f32 {
        let (e, v) = at.volts();
        let fraction = self.fraction.to_f32();
        match self.regime {
            Regime::Forward => fraction * (v - e),
            Regime::Braking => fraction * e,
            Regime::Reverse => e + fraction * v,
        }
    }
}

/// Fraction of a regime: 0 to 1 in units of 2^-30.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Fraction(U2F30);

impl Fraction {
    /// The fraction at the end of least torque.
    pub const ZERO: Self = Self(U2F30::ZERO);
    /// The fraction at the end of most torque.
    pub const ONE: Self = Self(U2F30::ONE);

    /// The ratio `part / whole`; 0 if `part <= 0` or `whole <= 0`, otherwise 1 if `part >= whole`. Rounded down for a
    /// `whole` of up to 33 bits. For a longer `whole` the result may be one unit too high.
    const fn ratio(part: i64, whole: i64) -> Self {
        if part <= 0 || whole <= 0 {
            Self::ZERO
        } else if part >= whole {
            Self::ONE
        } else {
            // Both numbers lose their low bits until `whole` has 33 bits, so that a shift by 30 bits does not overflow.
            let (part, whole) = (part.unsigned_abs(), whole.unsigned_abs());
            let surplus = 31u32.saturating_sub(whole.leading_zeros());
            Self(U2F30::from_bits((((part >> surplus) << 30) / (whole >> surplus)) as u32))
        }
    }

    /// The nearest duty.
    pub const fn to_duty(self) -> Duty {
        Duty::from_bits(((self.0.to_bits() + (1 << 14)) >> 15) as u16)
    }

    /// The fraction as the nearest `f32`, with an error below 2^-24.
    const fn to_f32(self) -> f32 {
        self.0.to_bits() as f32 / (1 << 30) as f32
    }

    /// The fraction, in double precision for reports.
    pub fn to_f64(self) -> f64 {
        f64::from(self.0)
    }
}

/// The control values of the four points for clockwise motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Points {
    /// S, the end of reverse driving: reverse 100 %.
    pub s: UnboundedControl,
    /// T, from reverse driving to braking: reverse 0 %, braking 100 %.
    pub t: UnboundedControl,
    /// Z, from braking to forward driving: both 0 %.
    pub z: UnboundedControl,
    /// G, the end of forward driving: forward 100 %.
    pub g: UnboundedControl,
}

impl Points {
    /// The points that the firmware uses. They follow from the paper's formulas. One exception: near and in overrun,
    /// Schemes C and D keep braking within the control range.
    ///
    /// In the paper's formula for Schemes C and D, T goes to minus infinity as |emf| approaches the battery voltage.
    /// Then no control value within the control range brakes noticeably. In *overrun*, where |emf| is at least the
    /// battery voltage, only braking slows a motor down. So the firmware limits T. Let u be |emf| / battery voltage.
    /// The share a is 0 up to u = 0.9, and grows linearly from there to 1 at u = 1.
    ///
    /// * Scheme C: T is at least `-controlMax / a`, and the ratio of S to T follows the formula. The negative end of
    ///   the control range then requests at least the share a of full dynamic braking.
    /// * Scheme D with a fixed blend: the points are blended from Scheme B and this limited Scheme C.
    /// * Scheme D with the automatic blend: T is limited as for Scheme C, but with a = 1 at all speeds. Below overrun
    ///   this limit equals a blend of Schemes B and C (0 is B, 1 is C) with the paper's automatic weight
    ///   `min(1, (1 - u) / (2 u^2))`.
    ///
    /// The limited points are continuous in the speed. They equal the paper's points up to u = 0.9, and with the
    /// automatic blend up to u = 1.
    ///
    /// No other point is limited to the control range. With Scheme A in overrun, for example, Z lies beyond the
    /// control range, and every positive control value brakes.
    pub const fn new(scheme: Scheme, at: OperatingPoint) -> Self {
        match scheme {
            Scheme::ForwardReverse => Self::on_line(UnboundedControl::ZERO, UnboundedControl::ZERO),
            Scheme::A => Self::scheme_a(at),
            Scheme::B => Self::scheme_b(at),
            Scheme::C => Self::scheme_c_down_to(near_overrun(at), at),
            Scheme::D(Blend::Fixed(weight)) => {
                blended(Self::scheme_b(at), Self::scheme_c_down_to(near_overrun(at), at), weight)
            }
            Scheme::D(Blend::Automatic) => Self::scheme_c_down_to(UnboundedControl::CONTROL_MIN, at),
        }
    }

    /// The points that the paper's formula gives, without the limits of [`new`](Self::new). In overrun the points of
    /// Scheme C describe no braking. A fixed blend of Scheme D mixes these points with the points of Scheme B. The
    /// automatic blend is 0 in overrun. Below overrun the points of the automatic blend equal the points of
    /// [`new`](Self::new). `None` for Schemes C and D if |emf| equals the battery voltage, where the formula of Scheme
    /// C is infinite.
    pub const fn from_formula(scheme: Scheme, at: OperatingPoint) -> Option<Self> {
        match scheme {
            Scheme::C => Self::scheme_c(at),
            Scheme::D(Blend::Fixed(weight)) => match Self::scheme_c(at) {
                Some(c) => Some(blended(Self::scheme_b(at), c, weight)),
                None => None,
            },
            // In overrun the blend is 0, so the result is the points of Scheme B.
            Scheme::D(Blend::Automatic) if at.is_overrun() => match Self::scheme_c(at) {
                Some(_) => Some(Self::scheme_b(at)),
                None => None,
            },
            Scheme::ForwardReverse | Scheme::A | Scheme::B | Scheme::D(Blend::Automatic) => {
                Some(Self::new(scheme, at))
            }
        }
    }

    /// The points of Scheme A: Z is at `controlMax e / V`.
    const fn scheme_a(at: OperatingPoint) -> Self {
        Self::on_line(UnboundedControl::ZERO, scaled(at.e, at.v()))
    }

    /// The points of Scheme B: T is at `-controlMax e / (V + e)`.
    const fn scheme_b(at: OperatingPoint) -> Self {
        let (e, v) = (at.e, at.v());
        Self::on_line(scaled(-e, v + e), UnboundedControl::ZERO)
    }

    /// The points of Scheme C by the paper's formula: S and T of Scheme B times `(V + e) / (V - e)`. `None` for e = V.
    const fn scheme_c(at: OperatingPoint) -> Option<Self> {
        let (e, v) = (at.e, at.v());
        if e == v {
            return None;
        }
        Some(Self {
            s: UnboundedControl::from_computed_bits(
                UnboundedControl::CONTROL_MAX.to_bits() - scaled(2 * v, v - e).to_bits(),
            ),
            ..Self::on_line(scaled(e, e - v), UnboundedControl::ZERO)
        })
    }

    /// The points of Scheme C, with T limited to `lowest`: in overrun, and where the formula gives a lower T.
    const fn scheme_c_down_to(lowest: UnboundedControl, at: OperatingPoint) -> Self {
        match Self::scheme_c(at) {
            Some(points) if !at.is_overrun() && points.t.to_bits() >= lowest.to_bits() => points,
            _ => {
                // S is T (V + e) / e. This branch is taken only for u >= 0.5. `lowest` is then between -11 controlMax
                // and -controlMax, so the product is below 2^63.
                let (e, v) = (at.e, at.v());
                let s = UnboundedControl::from_computed_bits(
                    lowest.to_bits() + div_round(lowest.to_bits() * v, e),
                );
                Self { s, ..Self::on_line(lowest, UnboundedControl::ZERO) }
            }
        }
    }

    /// Points with S and G at the ends of the control range.
    const fn on_line(t: UnboundedControl, z: UnboundedControl) -> Self {
        Self { s: UnboundedControl::CONTROL_MIN, t, z, g: UnboundedControl::CONTROL_MAX }
    }

    /// Locates a control value among the points (paper, section 1.3).
    ///
    /// A control value at Z is in the braking regime with the fraction 0, which opens the bridge. This also holds where
    /// T = Z. Where T differs from Z, a control value at T is full braking.
    pub const fn locate(&self, control: Control) -> Location {
        let c = UnboundedControl::of(control).to_bits();
        let (s, t) = (self.s.to_bits(), self.t.to_bits());
        let (z, g) = (self.z.to_bits(), self.g.to_bits());
        if c > z {
            Location { regime: Regime::Forward, fraction: Fraction::ratio(c - z, g - z) }
        } else if c >= t {
            Location { regime: Regime::Braking, fraction: Fraction::ratio(z - c, z - t) }
        } else {
            Location { regime: Regime::Reverse, fraction: Fraction::ratio(t - c, t - s) }
        }
    }
}

/// The regime of a requested mean voltage at the motor's terminals, and the mean current that the voltage requests, as
/// the voltage `w` of [`mod@super::linear_current`], in V. The voltage is in V and for CW motion. In overrun the
/// battery cannot drive a current: the current in forward driving is then at most 0.
pub(super) fn current(voltage: f32, at: OperatingPoint) -> (Regime, f32) {
    let (e, v) = at.volts();
    if voltage > e {
        (Regime::Forward, at_most(voltage, v) - e)
    } else {
        (if voltage < 0.0 { Regime::Reverse } else { Regime::Braking }, e - voltage)
    }
}

/// The share of a regime that the current `w` requests: 0 at the regime's end with the least torque, 1 at the other
/// end. The share may be above 1.
pub(super) fn share(regime: Regime, w: f32, at: OperatingPoint) -> f32 {
    let (e, v) = at.volts();
    let (least, most) = match regime {
        Regime::Forward => (0.0, v - e),
        Regime::Braking => (0.0, e),
        Regime::Reverse => (e, e + v),
    };
    if most > least { (w - least) / (most - least) } else { 0.0 }
}

/// The control value that requests this share of a regime. The error is at most about one control step, from rounding
/// and from the resolution of `f32`.
///
/// A control value beyond the control range is limited to the range. In a scheme without a braking regime, T equals Z:
/// every share of braking becomes the control value at Z, which requests no current.
pub(super) fn control(points: &Points, regime: Regime, share: f32) -> Control {
    let (from, to) = match regime {
        Regime::Forward => (points.z, points.g),
        Regime::Braking => (points.z, points.t),
        Regime::Reverse => (points.t, points.s),
    };
    let (from, to) = (from.to_f32(), to.to_f32());
    Control::saturating((roundf(from + share * (to - from)) as i32).into())
}

/// Limit of the magnitude of a point, in 1/256 control steps. With this limit the products of a blend fit into 64 bits.
const POINT_LIMIT_BITS: i64 = 1 << 45;

/// `controlMax * numerator / denominator`, rounded to 1/256 control step.
///
/// |numerator| must be below 2^38, so that the product stays below 2^61.
const fn scaled(numerator: i64, denominator: i64) -> UnboundedControl {
    UnboundedControl::from_bits(div_round(UnboundedControl::CONTROL_MAX.to_bits() * numerator, denominator))
}

/// Lowest T of Scheme C: `-controlMax / a`, where a = 10 u - 9, limited to 0 to 1 (see [`Points::new`]).
const fn near_overrun(at: OperatingPoint) -> UnboundedControl {
    let (e, v) = (at.e, at.v());
    let part = 10 * e - 9 * v;
    if part <= 0 {
        UnboundedControl::from_computed_bits(-POINT_LIMIT_BITS)
    } else if part >= v {
        UnboundedControl::CONTROL_MIN
    } else {
        scaled(-v, part)
    }
}

/// Blends S and T of Schemes B and C: `b + weight * (c - b)`.
const fn blended(b: Points, c: Points, weight: BlendFraction) -> Points {
    Points { s: between(b.s, c.s, weight), t: between(b.t, c.t, weight), ..b }
}

/// Blends one point.
const fn between(b: UnboundedControl, c: UnboundedControl, weight: BlendFraction) -> UnboundedControl {
    let step = (c.to_bits() - b.to_bits()) * weight.to_bits() as i64;
    UnboundedControl::from_computed_bits(b.to_bits() + div_round(step, BlendFraction::ONE.to_bits() as i64))
}

/// Divides and rounds to the nearest integer, halves away from zero. The denominator must not be 0.
const fn div_round(numerator: i64, denominator: i64) -> i64 {
    let (n, d) = (numerator.unsigned_abs(), denominator.unsigned_abs());
    let size = ((n + d / 2) / d) as i64;
    if (numerator < 0) == (denominator < 0) { size } else { -size }
}
