//! The duty that makes the motor's mean current the straight line that a control value asks for.
//!
//! At a given speed the bridge's current is not linear in duty. While the winding's current is
//! continuous it is nearly so, with an offset from the catch diodes; at light load the current falls
//! to zero within each PWM period and then grows with the square of the duty. This module inverts
//! both, in all three regimes, so that current is continuous and linear from S to G: it is the
//! drop across the diodes at T (the paper's to-do `controlReverse0`) that vanishes with the rest.
//!
//! Everything is seen from a motor that turns CW; voltages are in 1/16 mV, times are in winding time
//! constants. With `R2 = R + 2 Ron`, all of the resistance between the battery's terminals, the target
//! current `I` is given as the voltage `w = R2 I`, so the equivalent DC voltage of a control value is
//! `e + w` (paper, sections 2.1 and 3.2). For a current of that size through a drive state (9/8, 6/2):
//!
//! ```text
//! continuous:     D = (e + Vd + I (R + Ron)) / (V + Vd - I Ron)
//! discontinuous:  D T / tau = x  with  x - h + lambda h (1 - ln(1 + z) / z) = w T / (a tau),
//!                 h = 1 - exp(-x), z = k h, k = a / (lambda c)
//!                 a = V - e, c = e + Vd, tau = L / R2, lambda = R2 / (R + Ron)
//! ```
//!
//! (on time: the current rises towards `a / R2`; off time: it falls towards `-c / (R + Ron)` and stays
//! at 0) and for braking (5/0) `D = (V + 2 Vd - e + I R) / (V + 2 Vd - 2 I Ron)` with `a = e`,
//! `c = V + 2 Vd - e`, `lambda = R2 / R`. The duty is the smaller of the two. Driving against the
//! motion is driving with the motion at the speed `-e`.

use super::explog::{self, Decay, log_defect, mul, ratio_q20};
use super::points::{OperatingPoint, Place, Regime};
use crate::units::{Duty, RangeError};

/// What the duty stage must know of a motor and its bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Electrical {
    /// Winding resistance in milliohms, 1 to 65 535. A factor of two either way costs little.
    pub resistance_mohm: u16,
    /// Winding inductance in microhenries. `None`, or 0, if unknown: the current is then taken for
    /// continuous, the limit of a high PWM frequency.
    pub inductance_uh: Option<u16>,
    /// Drop of one catch diode in millivolts, up to 2000.
    pub diode_mv: u16,
    /// On-resistance of one closed switch in milliohms, up to 4095.
    pub switch_mohm: u16,
    /// PWM frequency in hertz, 100 to 200 000.
    pub pwm_hz: u32,
}

impl Electrical {
    /// The bridge of the reference calculations (0.7 V, 50 mohm) at 20 kHz with a NeveRest 60: a fair
    /// guess for any 12 V gear motor of a robot.
    pub const TYPICAL: Self = Self {
        resistance_mohm: 3300,
        inductance_uh: Some(694),
        diode_mv: 700,
        switch_mohm: 50,
        pwm_hz: 20_000,
    };
}

/// A ratio in steps of 2^-16.
type Q16 = u32;

/// [`Electrical`] prepared for use at every tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinearCurrent {
    electrical: Electrical,
    /// 1/16 mV.
    diode: i32,
    /// `Ron / R2`: 0 to 1/2.
    switch_share: Q16,
    /// `R2 / (R + Ron)`: 1 to 2.
    drive_lambda: Q16,
    /// `R2 / R`: 1 to 2.
    brake_lambda: Q16,
    /// PWM period over time constant `L / R2`, steps of 2^-20, up to 255; 0 if the inductance is
    /// unknown.
    period: u32,
    /// Its inverse, steps of 2^-20.
    inverse: u32,
    /// `(exp(period) - 1) / period`, steps of 2^-15: see [`Self::invert`].
    growth: u32,
}

impl LinearCurrent {
    /// [`Electrical::TYPICAL`], prepared.
    pub const TYPICAL: Self = match Self::new(Electrical::TYPICAL) {
        Ok(winding) => winding,
        Err(_) => panic!("in range"),
    };

    /// Prepares the constants.
    ///
    /// # Errors
    /// [`RangeError::Electrical`] if a quantity is out of the range stated with it.
    pub const fn new(electrical: Electrical) -> Result<Self, RangeError> {
        let Electrical { resistance_mohm, inductance_uh, diode_mv, switch_mohm, pwm_hz } = electrical;
        if resistance_mohm == 0 || diode_mv > 2_000 || switch_mohm > 4_095 || pwm_hz < 100 || pwm_hz > 200_000
        {
            return Err(RangeError::Electrical);
        }
        let (r, ron) = (resistance_mohm as u64, switch_mohm as u64);
        let inductance = match inductance_uh {
            Some(uh) => uh as u64,
            None => 0,
        };
        let r2 = r + 2 * ron;
        let period = period(r2, inductance, pwm_hz as u64);
        Ok(Self {
            electrical,
            diode: (diode_mv as i32) << 4,
            switch_share: ((ron << 16) / r2) as Q16,
            drive_lambda: lambda(r2, r + ron),
            brake_lambda: lambda(r2, r),
            period,
            inverse: if period == 0 { 0 } else { ((1 << 40) / period as u64) as u32 },
            growth: growth(period),
        })
    }

    /// What it was made for.
    pub const fn electrical(&self) -> Electrical {
        self.electrical
    }

    /// The duty of 9/8 for the current `w >= 0` at the back EMF `e`, which is negative for a motor that
    /// turns CCW. `w`, `e` and `v` in 1/16 mV, each below 2^22.
    const fn driving(&self, w: i32, e: i32, v: i32) -> Wanted {
        let through_switch = share(w, self.switch_share);
        Wanted {
            w,
            a: v - e,
            c: e + self.diode,
            lambda: self.drive_lambda,
            continuous: Fraction {
                part: e + self.diode + w - through_switch,
                whole: v + self.diode - through_switch,
            },
        }
    }

    /// The duty of 5/0 for the braking current `w >= 0` at the back EMF `e >= 0`, all as above.
    const fn braking(&self, w: i32, e: i32, v: i32) -> Wanted {
        let through_switches = 2 * share(w, self.switch_share);
        let both_diodes = v + 2 * self.diode;
        Wanted {
            w,
            a: e,
            c: both_diodes - e,
            lambda: self.brake_lambda,
            continuous: Fraction {
                part: both_diodes - e + w - through_switches,
                whole: both_diodes - through_switches,
            },
        }
    }

    /// The duty for the current that a fraction of a regime stands for: full driving is `V - e` with the
    /// motion and `V + e` against it, full braking is `e`.
    pub(super) const fn duty(&self, Place { regime, fraction }: Place, at: OperatingPoint) -> Duty {
        let (e, v) = at.sixteenths();
        self.invert(match regime {
            Regime::Forward => self.driving(fraction.of(v - e) as i32, e as i32, v as i32),
            Regime::Braking => self.braking(fraction.of(e) as i32, e as i32, v as i32),
            Regime::Reverse => self.driving((e + fraction.of(v)) as i32, -(e as i32), v as i32),
        })
    }

    const fn invert(&self, wanted: Wanted) -> Duty {
        let Wanted { w, a, c, lambda, continuous } = wanted;
        if w <= 0 {
            return Duty::ZERO;
        }
        let most = continuous.duty_bits();
        // Without a voltage that stops the current, or hardly any, it is continuous.
        if self.period == 0 || most == 0 || a <= 0 || c <= a >> 8 {
            return Duty::from_bits(most as u16);
        }
        // A current beyond a / R2 cannot be reached and does not stop. Nor does one that is still
        // rising at exp(x) = (k + exp(T/tau)) / (k + 1), which is below the x compared with here.
        let certain = self.growth as u64 * c as u64;
        if w >= a || most as u64 * (a + c) as u64 >= certain {
            return Duty::from_bits(most as u16);
        }
        let (a, c) = (a as u32, c as u32);
        let k = {
            let (high, rest) = ((a << 9) / c, (a << 9) % c);
            (high << 7) + (rest << 7) / c
        };
        let q = ((ratio_q20(w as u32, a) as u64 * self.period as u64) >> 16) as u32;
        let x = if self.period <= 1 << 20 {
            series(q, k)
        } else {
            // The continuous duty as a time bounds the answer from above.
            on_time(q, k, lambda, ((most as u64 * self.period as u64) >> 11) as u32)
        };
        let bits = ((x as u64 * self.inverse as u64) >> 29) as u32;
        Duty::from_bits(if bits < most { bits } else { most } as u16)
    }
}

/// `w` times a share in steps of 2^-16, rounded; both at least 0, `w` below 2^23.
const fn share(w: i32, share: Q16) -> i32 {
    ((w as i64 * share as i64 + (1 << 15)) >> 16) as i32
}

/// A current `w` that rises towards `a` and falls towards `-c`.
#[derive(Clone, Copy)]
struct Wanted {
    w: i32,
    a: i32,
    c: i32,
    lambda: Q16,
    /// The duty if the current is continuous.
    continuous: Fraction,
}

#[derive(Clone, Copy)]
struct Fraction {
    part: i32,
    whole: i32,
}

impl Fraction {
    /// In steps of 2^-15, clamped to 0 and 1.
    const fn duty_bits(self) -> u32 {
        if self.part <= 0 {
            return 0;
        }
        if self.part >= self.whole {
            return 1 << 15;
        }
        let (part, whole) = (self.part as u32, self.whole as u32);
        // Keep 16 bits of the denominator, so that one 32-bit division does.
        let shift = 16u32.saturating_sub(whole.leading_zeros());
        (((part >> shift) << 15) + (whole >> (shift + 1))) / (whole >> shift)
    }
}

/// PWM period in time constants, from milliohms, microhenries and hertz; steps of 2^-20.
///
/// Beyond 255 it is 255: the current then follows the switches at once. Below 2^-12, or without an
/// inductance, it is 0: the current then hardly changes within a period.
const fn period(r2: u64, inductance: u64, frequency: u64) -> u32 {
    if inductance == 0 {
        return 0;
    }
    // mohm / (uH Hz) is 1000 time constants. Below 2^17 * 1000 * 2^20 = 2^47.
    let period = ((r2 * 1000) << 20) / (inductance * frequency);
    if period > 255 << 20 {
        255 << 20
    } else if period <= 1 << 8 {
        0
    } else {
        period as u32
    }
}

/// `(exp(period) - 1) / period` in steps of 2^-15, saturating; from the period in steps of 2^-20.
const fn growth(period: u32) -> u32 {
    // The series has run out when its terms vanish; beyond 10 time constants it saturates.
    let (mut term, mut sum, mut n) = (1u64 << 15, 1u64 << 15, 1);
    while term > 0 && sum < u32::MAX as u64 {
        n += 1;
        term = ((term * period as u64) >> 20) / n;
        sum += term;
    }
    if sum > u32::MAX as u64 { u32::MAX } else { sum as u32 }
}

/// Ratio of the resistances in on and off time; beyond 2, which no usable bridge has, it is 2.
const fn lambda(on: u64, off: u64) -> Q16 {
    let ratio = (on << 16) / off;
    if ratio > 2 << 16 { 2 << 16 } else { ratio as Q16 }
}

/// The x of `x - h + lambda h (1 - ln(1 + z) / z) = q` with `h = 1 - exp(-x)` and `z = k h`, at most
/// `bound`; q, x and `bound` in steps of 2^-24; `ratio` is a / c, which is lambda k, up to 256.
const fn on_time(q: u32, ratio: Q16, lambda: Q16, bound: u32) -> u32 {
    let x = first_guess(q, ratio, bound);
    // One 32-bit division will do: 256 in steps of 2^-16, and 7 bits more.
    let k = ((ratio << 7) / (lambda >> 9)) as Q16;
    // Below 2^-14 the guess is as good as the arithmetic.
    if q <= 1 << 10 {
        return x;
    }
    // One step of Newton's method leaves less than 0.0003 of duty; more do not show beside what the
    // formula for the continuous current leaves (0.002 at 1 kHz).
    let decay = Decay::new(x);
    let z = scale(decay.gone, k);
    let z = if z > explog::MAX { explog::MAX } else { z };
    let value = decay.lag + scale(mul(decay.gone, log_defect(z)), lambda);
    // For lambda = 1, which is near enough: 1 - exp(-x) / (1 + z), in steps of 2^-16.
    let slope = (1u32 << 16).saturating_sub((decay.rest << 7) / ((explog::ONE + z) >> 9));
    let next = x as i64 - quotient(value as i64 - q as i64, if slope == 0 { 1 } else { slope });
    if next < 1 {
        1
    } else if next > bound as i64 {
        bound
    } else {
        next as u32
    }
}

/// The same for a period of at most one time constant, for which a series does (to 0.3 %):
/// `x = s (1 + n/2 + n^2/16 - n^3/87 + s^2/48)`, the last two terms fitted; n is below 1 then.
const fn series(q: u32, k: Q16) -> u32 {
    let Small { s, square, n } = Small::new(q, k);
    let n = if n > explog::ONE as u64 { explog::ONE } else { n as u32 };
    let bend = mul(n, explog::ONE / 2 + mul(n, explog::ONE / 16 - n / 87));
    // s is below 2 too.
    s + mul(s, bend + square as u32 / 48)
}

/// Where to begin when the series does not do; it also holds that `x <= q + 1`.
const fn first_guess(q: u32, k: Q16, bound: u32) -> u32 {
    let Small { s, n, .. } = Small::new(q, k);
    // Where n is large, the other bounds hold.
    let n = if n > 1 << 32 { 1 << 32 } else { n };
    let guess = s as u64 + ((s as u64 * n) >> 25);
    let most = if q < bound.saturating_sub(explog::ONE) { q + explog::ONE } else { bound };
    if guess > most as u64 { most } else { guess as u32 }
}

/// The quantities that are small with x: `s^2 = 2 q / (1 + k)`, where `k = a / c`, and
/// `n = (1 + 2k) s / 3`; steps of 2^-24.
struct Small {
    s: u32,
    square: u64,
    n: u64,
}

impl Small {
    const fn new(q: u32, k: Q16) -> Self {
        let inverse = u32::MAX / ((1 << 16) + k);
        let square = (2 * q as u64 * inverse as u64) >> 16;
        let s = sqrt(square);
        // A third.
        let n = (s as u64 * (((1 << 16) + 2 * k) / 3) as u64) >> 16;
        Self { s, square, n }
    }
}

/// Square root of a number below 2^9 in steps of 2^-24, to 15 bits.
const fn sqrt(square: u64) -> u32 {
    if square == 0 {
        return 0;
    }
    // An even shift that fills 32 bits.
    let shift = (32 - (64 - square.leading_zeros() as i32)) & !1;
    let root = if shift >= 0 { (square as u32) << shift } else { (square >> -shift) as u32 }.isqrt();
    // sqrt(n 2^-24) = sqrt(n 2^shift) 2^(-shift/2) 2^-12; the root has 16 bits.
    (root << 13) >> (1 + shift / 2)
}

/// `x` times a ratio, saturating.
const fn scale(x: u32, k: Q16) -> u32 {
    let product = (x as u64 * k as u64) >> 16;
    if product > u32::MAX as u64 { u32::MAX } else { product as u32 }
}

/// `difference` over a slope in steps of 2^-16.
const fn quotient(difference: i64, slope: u32) -> i64 {
    let size = difference.unsigned_abs();
    let size = if size > u32::MAX as u64 { u32::MAX } else { size as u32 };
    // As many bits as fit before one 32-bit division, up to the 16 that the slope wants.
    let zeros = size.leading_zeros();
    let shift = if zeros > 16 { 16 } else { zeros };
    let size = (((size << shift) / slope) as i64) << (16 - shift);
    if difference < 0 { -size } else { size }
}
