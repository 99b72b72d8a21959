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

use super::explog::{Decay, ONE, Q28, div, log_defect, mul};
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

/// [`Electrical`] prepared for use at every tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinearCurrent {
    electrical: Electrical,
    /// 1/16 mV.
    diode: i64,
    /// `Ron / R2`: 0 to 1/2.
    switch_share: Q28,
    /// m of the drive states, `(R + Ron) / R2`: 1/2 to 1.
    drive_share: Q28,
    /// m of braking, `R / R2`. Below 1/2, which no usable bridge has, it is 1/2.
    brake_share: Q28,
    /// `None` for a current that hardly changes within a period.
    period: Option<Period>,
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
        let (r, ron) = (resistance_mohm as i64, switch_mohm as i64);
        let r2 = r + 2 * ron;
        let brake_share = div(r, r2);
        Ok(Self {
            electrical,
            diode: (diode_mv as i64) << 4,
            switch_share: div(ron, r2),
            drive_share: div(r + ron, r2),
            brake_share: if brake_share < ONE / 2 { ONE / 2 } else { brake_share },
            period: match inductance_uh {
                None | Some(0) => None,
                Some(uh) => Period::new(r2, uh as i64, pwm_hz as i64),
            },
        })
    }

    /// What it was made for.
    pub const fn electrical(&self) -> Electrical {
        self.electrical
    }

    /// The duty for the current that a fraction of a regime stands for: full driving is `V - e` with the
    /// motion and `V + e` against it, full braking is `e`.
    pub(super) const fn duty(&self, Place { regime, fraction }: Place, at: OperatingPoint) -> Duty {
        let (e, v) = at.sixteenths();
        match regime {
            Regime::Forward => self.driving(fraction.of(v - e), e, v),
            Regime::Braking => self.braking(fraction.of(e), e, v),
            Regime::Reverse => self.driving(e + fraction.of(v), -e, v),
        }
    }

    /// The duty of 9/8 at the back EMF `e`, which is negative for a motor that turns CCW.
    const fn driving(&self, w: i64, e: i64, v: i64) -> Duty {
        let switch = mul(w, self.switch_share);
        let continuous = share(e + self.diode + w - switch, v + self.diode - switch);
        self.smaller(continuous, Pulse { w, a: v - e, c: e + self.diode, m: self.drive_share })
    }

    /// The duty of 5/0 at the back EMF `e`, at least 0.
    const fn braking(&self, w: i64, e: i64, v: i64) -> Duty {
        let switches = 2 * mul(w, self.switch_share);
        let open = v + 2 * self.diode;
        let continuous = share(open - e + w - switches, open - switches);
        self.smaller(continuous, Pulse { w, a: e, c: open - e, m: self.brake_share })
    }

    /// The duty of a continuous current, or of a pulse if that is less.
    const fn smaller(&self, continuous: Q28, pulse: Pulse) -> Duty {
        let duty = match self.period {
            _ if pulse.w <= 0 => 0,
            Some(period) if pulse.may_end(continuous, period) => {
                let duty = pulse.duty(period.length, mul(continuous, period.length));
                if duty < continuous { duty } else { continuous }
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
    const fn may_end(self, continuous: Q28, period: Period) -> bool {
        self.c > 0 && self.w < self.a && continuous * (self.a + self.c) < period.growth * self.c
    }

    /// The x of `m (x - h) + h (1 - ln(1 + z) / z) = m q`, at most `most`, as a share of the period.
    ///
    /// The left side is convex, at most `m x^2/2 (a + c) / c` and at most x; it is at least m (x - 1). So
    /// the root lies within the bounds below, and from the lower one two steps of Newton's method leave
    /// less than 2e-4 of a duty.
    const fn duty(self, period: Q28, most: Q28) -> Q28 {
        let Self { w, a, c, m } = self;
        let q = w * period / a;
        let root = 1 + (((2 * q * c / (a + c)) << 24).isqrt() << 2);
        let lower = if root > mul(m, q) { root } else { mul(m, q) };
        let upper = if q + ONE < most { q + ONE } else { most };

        let mut x = if lower < upper { lower } else { upper };
        let mut steps = 0;
        while steps < 2 {
            let Decay { gone, lag } = Decay::new(x);
            let z = mul(m, gone) * a / c;
            let value = mul(m, lag) + mul(gone, log_defect(z));
            let slope = mul(m, gone) + mul(ONE - gone, ONE - div(ONE, ONE + z));
            x += div(mul(m, q) - value, slope);
            x = if x < lower { lower } else { x };
            x = if x > upper { upper } else { x };
            steps += 1;
        }
        div(x, period)
    }
}

/// `part / whole`, clamped to 0 and 1.
const fn share(part: i64, whole: i64) -> Q28 {
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
struct Period {
    /// In time constants, 2^-10 to 127.
    length: Q28,
    /// `(exp(length) - 1) / length`, at most 2^12.
    growth: Q28,
}

impl Period {
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
        Some(Self { length, growth })
    }
}
