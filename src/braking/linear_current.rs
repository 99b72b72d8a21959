//! The duty that makes the motor's mean current the straight line that a control value asks for.
//!
//! At a given speed the bridge's current is not linear in duty. While the winding's current is
//! continuous it is nearly so, with an offset from the catch diodes; at light load the current falls
//! to zero within each PWM period and then grows with the square of the duty. This module inverts
//! both, in all three regimes, so that current is continuous and linear from S to G: it is the
//! drop across the diodes at T (the paper's to-do `controlReverse0`) that vanishes with the rest.
//!
//! Everything is seen from a motor that turns CW; voltages are in 1/16 mV, times in winding time
//! constants. With `R2 = R + 2 Ron`, all of the resistance between the battery's terminals, the target
//! current `I` is given as the voltage `w = R2 I`, so the equivalent DC voltage of a control value is
//! `e + w` (paper, sections 2.1 and 3.2). For a current of that size through a drive state (9/8, 6/2):
//!
//! ```text
//! continuous:     D = (e + Vd + I (R + Ron)) / (V + Vd - I Ron)
//! discontinuous:  D T / tau = x  with  m (x - h) + h (1 - ln(1 + z) / z) = m q,  q = w T / (a tau),
//!                 h = 1 - exp(-x), z = m h a / c, a = V - e, c = e + Vd, tau = L / R2, m = (R + Ron) / R2
//! ```
//!
//! (on time: the current rises towards `a / R2`; off time: it falls towards `-c / (R + Ron)` and stays
//! at 0) and for braking (5/0) `D = (V + 2 Vd - e + I R) / (V + 2 Vd - 2 I Ron)` with `a = e`,
//! `c = V + 2 Vd - e`, `m = R / R2`. The duty is the smaller of the two. Driving against the motion is
//! driving with the motion at the speed `-e`.
//!
//! ```
//! use motor_hub::braking::{LinearCurrent, OperatingPoint, Scheme, Winding, place, place_current};
//! use motor_hub::bridge::BridgeConstants;
//! use motor_hub::units::{Control, CountsPerSecond, Millivolts};
//!
//! // A little current at half of the free speed flows in pulses, and takes more duty than its share.
//! let winding = Winding::NEVEREST_60;
//! let current = LinearCurrent::new(&winding, &BridgeConstants::VNH5019);
//! let emf = winding.emf.emf(CountsPerSecond::new(1505));
//! let at = OperatingPoint::new(emf, Millivolts::new(12_000)).expect("there is a battery");
//! let control = Control::new(1_000);
//! let linear = place_current(&current, Scheme::B, at, control).drive;
//! assert!(linear.duty > place(Scheme::B, at, control).drive.duty);
//! ```

use super::explog::{Decay, Logarithm, ONE, Q28, div, mul, scale};
use super::points::{OperatingPoint, Place, Regime};
use super::winding::Winding;
use crate::bridge::BridgeConstants;
use crate::units::Duty;

/// A winding behind a bridge, prepared for use at every tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinearCurrent {
    /// 1/16 mV.
    diode: i64,
    /// `Ron / R2`: 0 to 1/2.
    switch_share: Q28,
    /// m of the drive states, `(R + Ron) / R2`: 1/2 to 1.
    drive_share: Q28,
    /// m of braking, `R / R2`. Below 1/2, which no usable bridge has, it is 1/2.
    brake_share: Q28,
    /// `None` for a current that hardly changes within a period.
    period: Option<PwmPeriod>,
}

impl LinearCurrent {
    /// Prepares the constants.
    pub const fn new(winding: &Winding, bridge: &BridgeConstants) -> Self {
        let (r, ron) = (winding.resistance.as_milliohms() as i64, bridge.switch_mohm() as i64);
        let r2 = r + 2 * ron;
        let brake_share = div(r, r2);
        Self {
            diode: (bridge.diode_mv() as i64) << 4,
            switch_share: div(ron, r2),
            drive_share: div(r + ron, r2),
            brake_share: if brake_share < ONE / 2 { ONE / 2 } else { brake_share },
            period: match winding.inductance {
                None => None,
                Some(l) => PwmPeriod::new(r2, l.as_microhenries() as i64, bridge.pwm_hz() as i64),
            },
        }
    }

    /// The duty for the current that a fraction of a regime stands for: full driving is `V - e` with the
    /// motion and `V + e` against it, full braking is `e`.
    pub(super) fn duty(&self, Place { regime, fraction }: Place, at: OperatingPoint) -> Duty {
        let (e, v) = at.sixteenths();
        match regime {
            Regime::Forward => self.driving(fraction.of(v - e), e, v),
            Regime::Braking => self.braking(fraction.of(e), e, v),
            Regime::Reverse => self.driving(e + fraction.of(v), -e, v),
        }
    }

    /// The duty of 9/8 at the back EMF `e`, which is negative for a motor that turns CCW.
    fn driving(&self, w: i64, e: i64, v: i64) -> Duty {
        let switch = mul(w, self.switch_share);
        let continuous = share(e + self.diode + w - switch, v + self.diode - switch);
        self.smaller(continuous, Pulse { w, a: v - e, c: e + self.diode, m: self.drive_share })
    }

    /// The duty of 5/0 at the back EMF `e`, at least 0.
    fn braking(&self, w: i64, e: i64, v: i64) -> Duty {
        let switches = 2 * mul(w, self.switch_share);
        let open = v + 2 * self.diode;
        let continuous = share(open - e + w - switches, open - switches);
        self.smaller(continuous, Pulse { w, a: e, c: open - e, m: self.brake_share })
    }

    /// The duty of a continuous current, or of a pulse if that is less.
    fn smaller(&self, continuous: Q28, pulse: Pulse) -> Duty {
        let duty = match self.period {
            _ if pulse.w <= 0 => 0,
            Some(period) if pulse.may_end(continuous, period) => {
                pulse.duty(period, mul(continuous, period.length)).min(continuous)
            }
            _ => continuous,
        };
        Duty::from_bits(((duty + (1 << 12)) >> 13) as u16)
    }
}

/// A current with the mean `w` that rises from 0 towards `a` and falls towards `-c`, and the share `m` of
/// the resistance that is left when it falls.
#[derive(Clone, Copy)]
struct Pulse {
    w: i64,
    a: i64,
    c: i64,
    m: Q28,
}

impl Pulse {
    /// False if it is certain to last into the next period: nothing stops it, its mean cannot be reached,
    /// or the duty is beyond that of a pulse of one period, whose on time
    /// `ln(1 + (exp(T / tau) - 1) c / (a + c))` is less than what is compared with here.
    fn may_end(self, continuous: Q28, period: PwmPeriod) -> bool {
        self.c > 0 && self.w < self.a && continuous * (self.a + self.c) < period.growth * self.c
    }

    /// The x of `m (x - h) + h (1 - ln(1 + z) / z) = m q`, at most `most`, as a share of the period.
    ///
    /// With `k = a / c` the left side begins as `m x^2/2 (1 + k) (1 - (1 + 2k) x/3)`, so x as
    /// `s + (1 + 2k) s^2/6` with `s^2 = 2 q / (1 + k)`; and it is at least m (x - 1). From the smaller of the
    /// two a single step of Newton's method leaves less than 3e-4 of a duty.
    fn duty(self, period: PwmPeriod, most: Q28) -> Q28 {
        let Self { w, a, c, m } = self;
        let q = scale(w, period.length, a);
        // q / (1 + k)
        let part = scale(q, c, a + c);
        let root = 1 + (((2 * part) << 24).isqrt() << 2);
        let series = root + mul(2 * q - part, ONE / 3);
        let upper = most.min(q + ONE);
        let guess = series.min(upper);

        let Decay { gone, lag } = Decay::new(guess);
        let Logarithm { defect, inverse } = Logarithm::new(scale(mul(m, gone), a, c));
        let value = mul(m, lag) + mul(gone, defect);
        let slope = mul(m, gone) + mul(ONE - gone, ONE - inverse);
        let missing = mul(m, q) - value;
        let step = div(missing.abs(), slope.max(1));
        let x = if missing < 0 { guess - step } else { guess + step };
        mul(x.max(1).min(upper), period.inverse)
    }
}

/// `part / whole`, clamped to 0 and 1.
fn share(part: i64, whole: i64) -> Q28 {
    if part <= 0 {
        0
    } else if part >= whole {
        ONE
    } else {
        div(part, whole)
    }
}

/// A PWM period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct PwmPeriod {
    /// In time constants, 2^-10 to 127.
    length: Q28,
    /// Periods in a time constant.
    inverse: Q28,
    /// `(exp(length) - 1) / length`, at most 2^12.
    growth: Q28,
}

impl PwmPeriod {
    /// From milliohms, microhenries and hertz.
    ///
    /// Beyond 127 it is 127: the current then follows the switches at once. Below 2^-10 there is none:
    /// the current then hardly changes within a period.
    const fn new(r2: i64, inductance: i64, frequency: i64) -> Option<Self> {
        // mohm / (uH Hz) is 1000 time constants. The numerator is below 2^27.
        let length = div(r2 * 1000, inductance * frequency);
        if length <= ONE >> 10 {
            return None;
        }
        let length = if length < 127 * ONE { length } else { 127 * ONE };
        let gone = Decay::new(length).gone;
        let fading = mul(length, ONE - gone);
        let growth = if fading > gone >> 12 { div(gone, fading) } else { ONE << 12 };
        Some(Self { length, inverse: div(ONE, length), growth })
    }
}
