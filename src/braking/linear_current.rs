//! The duty that makes the motor's mean current the straight line that a control value asks for.
//!
//! At a given speed the bridge's current is not linear in duty. While the winding's current is
//! continuous it is nearly so, with an offset from the catch diodes; at light load the current falls
//! to zero within each PWM period and then grows with the square of the duty. This module inverts
//! both, in all three regimes, so that current is continuous and linear from S to G: it is the
//! drop across the diodes at T (the paper's to-do `controlReverse0`) that vanishes with the rest.
//!
//! Everything is seen from a motor that turns CW; voltages are in volts, times in winding time
//! constants. With `R2 = R + 2 Ron`, all of the resistance between the battery's terminals, the target
//! current `I` is given as the voltage `w = R2 I`, so the equivalent DC voltage of a control value is
//! `e + w` (paper, sections 2.1 and 3.2). For a current of that size through a drive state (9/8, 6/2):
//!
//! ```text
//! continuous:     D = (c + m w) / (a + c - k w)
//! discontinuous:  D T / tau = x  with  m (x - h) + h (1 - ln(1 + z) / z) = m q,  q = w T / (a tau),
//!                 h = 1 - exp(-x), z = m h a / c, tau = L / R2
//! ```
//!
//! While the bridge is on the current rises towards `a / R2`, while it is off it falls towards
//! `-c / (m R2)` and stays at 0; k is the share of R2 that is in the circuit only when the bridge is on,
//! `m = 1 - k`:
//!
//! | | a | c | k |
//! |---|---|---|---|
//! | driving (9/8, 6/2) | `V - e` | `e + Vd` | `Ron / R2` |
//! | braking (5/0) | `e` | `V + 2 Vd - e` | `2 Ron / R2` |
//!
//! The duty is the smaller of the two. Driving against the motion is driving with the motion at the speed
//! `-e`. From a duty to its current the same equations give `w` at once, and the larger is right.
//!
//! Of a bridge whose [timing](crate::bridge::Timing) is known, its edges are made up for. In a continuous current an edge of
//! length t acts like a step in its middle; a current that begins in it at zero begins late, as if the step came
//! `t (1 - a / (2 (a + c)))` after the edge's beginning. And a duty that the bridge must be spared becomes the nearest
//! that it may have: what is lost by that, no duty can give.
//!
//! All of it is in single precision: no formula takes a small difference of large numbers, and a duty has
//! 15 bits.
//!
//! ```
//! use motor_hub::braking::{LinearCurrent, OperatingPoint, Scheme, Winding, linear_current, linear_duty};
//! use motor_hub::bridge::BridgeConstants;
//! use motor_hub::units::{Control, CountsPerSecond, Millivolts};
//!
//! // A little current at half of the free speed flows in pulses, and takes more duty than its share.
//! let winding = Winding::NEVEREST_60;
//! let current = LinearCurrent::new(&winding, &BridgeConstants::IDEAL);
//! let emf = winding.emf.emf(CountsPerSecond::new(1505));
//! let at = OperatingPoint::new(emf, Millivolts::new(12_000)).expect("there is a battery");
//! let control = Control::new(1_000);
//! let linear = linear_current(&current, Scheme::B, at, control).drive;
//! assert!(linear.duty > linear_duty(Scheme::B, at, control).drive.duty);
//! ```

use super::points::{Location, OperatingPoint, Regime};
use super::winding::Winding;
use crate::bridge::{BridgeConstants, Timing};
use crate::units::Duty;
use crate::units::single::{at_least, at_most};
use libm::{expm1f, log1pf, roundf, sqrtf};

/// A winding behind a bridge, prepared for use at every tick.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinearCurrent {
    /// Volts.
    diode: f32,
    /// `Ron / R2`: 0 to 1/4. More, which no usable bridge has, is 1/4.
    switch_share: f32,
    /// `None` for a current that hardly changes within a period.
    period: Option<PwmPeriod>,
    timing: Shares,
}

/// A bridge's timing, in shares of the PWM period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct Shares {
    least_off: f32,
    least_on: f32,
    turn_on: f32,
    turn_off: f32,
}

impl Shares {
    fn new(bridge: &BridgeConstants) -> Self {
        let share = |ns: u16| f32::from(ns) * 1e-9 * bridge.pwm_hz() as f32;
        let Timing { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, .. } = bridge.timing();
        Self {
            least_off: share(least_off_ns),
            least_on: share(least_on_ns),
            turn_on: share(turn_on_ns),
            turn_off: share(turn_off_ns),
        }
    }

    /// The nearest duty that the bridge may be given; 0 and 1, where its line stands still, always.
    fn allowed(&self, duty: f32) -> f32 {
        let Self { least_off, least_on, .. } = *self;
        let most = 1.0 - least_off;
        if duty >= least_on && duty <= most {
            duty
        } else if least_on > most {
            roundf(duty)
        } else if duty < least_on {
            if 2.0 * duty < least_on { 0.0 } else { least_on }
        } else if 2.0 * (1.0 - duty) < least_off {
            1.0
        } else {
            most
        }
    }
}

impl LinearCurrent {
    /// Prepares the constants.
    pub fn new(winding: &Winding, bridge: &BridgeConstants) -> Self {
        let ron = f32::from(bridge.switch_mohm());
        let r2 = f32::from(winding.resistance.as_milliohms()) + 2.0 * ron;
        Self {
            diode: f32::from(bridge.diode_mv()) / 1000.0,
            switch_share: at_most(ron / r2, 0.25),
            period: winding.inductance.and_then(|inductance| {
                // mohm / (uH Hz) is 1000 time constants.
                let frequency = bridge.pwm_hz() as f32;
                PwmPeriod::new(1000.0 * r2 / (f32::from(inductance.as_microhenries()) * frequency))
            }),
            timing: Shares::new(bridge),
        }
    }

    /// The duty for the current that a fraction of a regime stands for: full driving is `V - e` with the
    /// motion and `V + e` against it, full braking is `e`.
    pub(super) fn duty(&self, location: Location, at: OperatingPoint) -> Duty {
        let w = location.current(at);
        let duty = if w > 0.0 { self.stage(location.regime, at).duty(w, self.period) } else { 0.0 };
        to_duty(self.timing.allowed(duty))
    }

    /// The nearest duty that the bridge may be given.
    pub(super) fn allowed(&self, duty: Duty) -> Duty {
        to_duty(self.timing.allowed(duty.to_f32()))
    }

    /// The voltage behind the mean current of a duty, which [`duty`](Self::duty) inverts.
    pub(super) fn current(&self, regime: Regime, duty: Duty, at: OperatingPoint) -> f32 {
        self.stage(regime, at).current(duty.to_f32(), self.period)
    }

    /// What a winding's current falls against while its bridge is open: the bus and two diodes, in volts.
    pub(super) const fn bus(&self, battery: f32) -> f32 {
        battery + 2.0 * self.diode
    }

    const fn stage(&self, regime: Regime, at: OperatingPoint) -> Stage {
        let (e, v) = at.volts();
        let Shares { turn_on, turn_off, .. } = self.timing;
        match regime {
            Regime::Forward => Stage { a: v - e, c: e + self.diode, k: self.switch_share, turn_on, turn_off },
            Regime::Braking => {
                Stage { a: e, c: v + 2.0 * self.diode - e, k: 2.0 * self.switch_share, turn_on, turn_off }
            }
            Regime::Reverse => Stage { a: v + e, c: self.diode - e, k: self.switch_share, turn_on, turn_off },
        }
    }
}

/// A bridge that makes the current rise towards `a` while it is on and fall towards `-c` while it is off;
/// `k` is the share of the resistance that is in the circuit only while it is on.
#[derive(Clone, Copy)]
struct Stage {
    a: f32,
    c: f32,
    k: f32,
    /// Of the period.
    turn_on: f32,
    turn_off: f32,
}

impl Stage {
    /// The share of the resistance that is left when the current falls.
    const fn m(self) -> f32 {
        1.0 - self.k
    }

    /// The duty of a mean current, above 0.
    fn duty(self, w: f32, period: Option<PwmPeriod>) -> f32 {
        let Self { a, c, k, .. } = self;
        let (part, whole) = (c + self.m() * w, a + c - k * w);
        if part <= 0.0 {
            return 0.0;
        } else if part >= whole {
            return 1.0;
        }
        let continuous = part / whole;
        let held = (continuous + self.late_continuous()).clamp(0.0, 1.0);
        match period {
            Some(period) if w < a && self.may_end(continuous, period) => {
                let most = continuous * period.length;
                let pulse = self.on_time(w * period.length / a, most) / period.length;
                at_most(held, pulse + self.late_pulse())
            }
            _ => held,
        }
    }

    /// How much longer than the duty meant, in shares of the period, the PWM line must be high for a continuous current.
    const fn late_continuous(self) -> f32 {
        (self.turn_on - self.turn_off) / 2.0
    }

    /// The same for one that begins at zero.
    fn late_pulse(self) -> f32 {
        if self.turn_on == 0.0 && self.turn_off == 0.0 {
            return 0.0;
        }
        self.turn_on * (1.0 - self.a / (2.0 * (self.a + self.c))) - self.turn_off / 2.0
    }

    /// The mean current of a duty. Where the motor pushes harder than the battery it is negative, as much as
    /// the duty lets through.
    fn current(self, duty: f32, period: Option<PwmPeriod>) -> f32 {
        let Self { a, c, k, .. } = self;
        if a <= 0.0 {
            return duty * a;
        }
        // A line that stands still has no edges.
        let moves = duty > 0.0 && duty < 1.0;
        let less = |late: f32| if moves { (duty - late).clamp(0.0, 1.0) } else { duty };
        let held = less(self.late_continuous());
        let continuous = at_least((held * (a + c) - c) / (self.m() + held * k), 0.0);
        match period {
            Some(period) if self.may_end(held, period) => {
                let (q, _) = self.pulse(less(self.late_pulse()) * period.length);
                at_least(continuous, q * a / period.length)
            }
            _ => continuous,
        }
    }

    /// False if the current is certain to last into the next period: nothing stops it, or the duty is beyond
    /// that of a pulse of one period, whose on time `ln(1 + (exp(T / tau) - 1) c / (a + c))` is less than
    /// what is compared with here.
    fn may_end(self, duty: f32, period: PwmPeriod) -> bool {
        self.c > 0.0 && duty * (self.a + self.c) < period.growth * self.c
    }

    /// The q of an on time x, and how fast it grows with x.
    fn pulse(self, x: f32) -> (f32, f32) {
        let Self { a, c, .. } = self;
        let m = self.m();
        let h = -expm1f(-x);
        let z = m * h * a / c;
        let defect = if z > 0.0 { 1.0 - log1pf(z) / z } else { 0.0 };
        (x - h + h * defect / m, h + (1.0 - h) * z / (1.0 + z) / m)
    }

    /// The x of a q, at most `most`.
    ///
    /// With `k = a / c` q begins as `x^2/2 (1 + k) (1 - (1 + 2k) x/3)`, so x as `s + (1 + 2k) s^2/6` with
    /// `s^2 = 2 q / (1 + k)`; and it is at least x - 1. From the smaller of the two a single step of
    /// Newton's method leaves less than 3e-4 of a duty.
    fn on_time(self, q: f32, most: f32) -> f32 {
        let part = q * self.c / (self.a + self.c);
        let series = sqrtf(2.0 * part) + (2.0 * q - part) / 3.0;
        let upper = at_most(most, q + 1.0);
        let guess = at_most(series, upper);
        let (reached, slope) = self.pulse(guess);
        at_most(at_least(guess + (q - reached) / at_least(slope, f32::MIN_POSITIVE), 0.0), upper)
    }
}

/// The nearest duty to 0 to 1.
fn to_duty(duty: f32) -> Duty {
    Duty::from_bits((32_768.0 * duty + 0.5) as u16)
}

/// A PWM period.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct PwmPeriod {
    /// In time constants, 2^-10 to 127.
    length: f32,
    /// `(exp(length) - 1) / length`, at most 2^12.
    growth: f32,
}

impl PwmPeriod {
    /// Beyond 127 time constants it is 127: the current then follows the switches at once. Below 2^-10 there
    /// is none: the current then hardly changes within a period.
    fn new(length: f32) -> Option<Self> {
        let length = at_most(length, 127.0);
        (length > 1.0 / 1024.0).then(|| Self { length, growth: at_most(expm1f(length) / length, 4096.0) })
    }
}
