//! The linear-current rule: the duty with which the motor's mean current is linear in the control value.
//!
//! At a given speed the mean current of a bridge is not linear in the duty. While the winding's current is continuous,
//! the relation is nearly linear, with an offset from the catch diodes. At light load the current is discontinuous: the
//! current falls to zero within each PWM period, and the mean current grows with the square of the duty. This module
//! inverts both relations in all three regimes. The mean current is then linear in the control value between each two
//! adjacent points of S, T, Z and G. In Schemes A to D the mean current has no jump at a point. At T a diode replaces a
//! switch in the current's path, which the formulas include.
//!
//! All formulas are for CW motion. Voltages are in V:
//!
//! * `V` is the battery voltage, `e` the back EMF, `Vd` the drop of a diode.
//! * `R` is the resistance of the winding, `Ron` the resistance of a closed switch, and `R2 = R + 2 Ron` the resistance
//!   of the winding with two closed switches.
//! * `P` is the PWM period, and `tau = L / R2` the winding's time constant.
//! * `w = R2 I` is the target current `I` as a voltage, positive in the direction of the regime. A DC voltage at the
//!   terminals that gives the same current is `e + w` in forward driving, and `e - w` in braking and reverse driving
//!   (paper, sections 2.1 and 3.2).
//! * `x` is the on time in time constants. `h`, `z` and `q` abbreviate the expressions below.
//!
//! The duty D for the target current is:
//!
//! ```text
//! continuous:     D = (c + m w) / (a + c - k w)
//! discontinuous:  D P / tau = x  with  m (x - h) + h (1 - ln(1 + z) / z) = m q,  q = w P / (a tau),
//!                 h = 1 - exp(-x), z = m h a / c
//! ```
//!
//! While the bridge is on, the current rises towards `a / R2`. While the bridge is off, the current falls towards
//! `-c / (m R2)` and stops at 0. k is the share of R2 that is in the circuit only while the bridge is on, and
//! `m = 1 - k`:
//!
//! | | a | c | k |
//! |---|---|---|---|
//! | driving (9/8, 6/2) | `V - e` | `e + Vd` | `Ron / R2` |
//! | braking (5/0) | `e` | `V + 2 Vd - e` | `2 Ron / R2` |
//!
//! This module uses the smaller of these two duties. For m = 1 the smaller duty is exact. Where the current stops
//! within the period, the formula of the continuous current gives too much duty. Where the current never stops, the
//! formula of the discontinuous current gives too much duty. For m below 1 both formulas are approximations. With m =
//! 0.95 the error of the duty is 3e-4 at P = 0.3 tau, and 2e-3 at P = tau. The inverse solves the same equations for
//! `w`, and uses the larger of the two currents. Reverse driving (6/2) uses the row of forward driving with `-e` in
//! place of `e`.
//!
//! **Within a tick** the duty stays, and the speed changes. A change of `e` changes a continuous current `w` by the
//! same voltage, so the current falls with the time constant of the motor. The mean of a discontinuous current is
//! nearly proportional to `a (a + c) / c`, where `a + c` is constant. So `w` changes only by the share `w (1/a + 1/c)`
//! of a change of `e`.
//!
//! `a0`, `c0` and `w0` are the values at the beginning of the tick, `a1` and `c1` the values at its end. `N` is the
//! length of the tick in mechanical time constants of the motor. In each regime the current reduces `a`. Without a
//! load, a motor that reaches the back EMF of `a1` by the tick's end needs the current `w0` at the beginning:
//!
//! ```text
//! a' = -w / (time constant)  with  w = w0 (a / a0) (c0 / c)
//! integrated:  w0 = (a0 / c0) ((a + c) ln(a0 / a1) + a1 - a0) / N
//! ```
//!
//! A load that needs the current `wl` adds `wl (a0 c1) / (a1 c0)` to `w0`: the current at the beginning of the tick
//! that becomes `wl` at its end. The sum is exact for a steady speed and without a load, and otherwise an
//! approximation.
//!
//! The duty compensates the edges of the output. The [timing](crate::bridge::Timing) of the bridge has the lengths of
//! the edges, which are 0 for an ideal bridge. For a continuous current an edge of length t acts like a step in the
//! middle of the edge. A discontinuous current starts from zero within the edge at turn-on. This edge acts like a step
//! at the time `t (1 - a / (2 (a + c)))` after its start. A duty that the timing does not permit is replaced by the
//! nearest permitted duty. The current then has an error that no duty avoids.
//!
//! Single precision is enough, because a duty has 15 bits. For on times far below a time constant, `x - h` and `1 -
//! ln(1 + z) / z` lose digits. The error of the duty stays below 4 / 32768.
//!
//! ```
//! use motor_hub::braking::{LinearCurrent, OperatingPoint, Scheme, Winding, linear_current, linear_duty};
//! use motor_hub::bridge::BridgeConstants;
//! use motor_hub::units::{Control, CountsPerSecond, Millivolts};
//!
//! // At half of the free speed a small current is discontinuous. It needs more duty than the linear-duty rule gives.
//! let winding = Winding::NEVEREST_60;
//! let current = LinearCurrent::new(&winding, &BridgeConstants::IDEAL);
//! let emf = winding.emf.emf(CountsPerSecond::new(1505));
//! let at = OperatingPoint::new(emf, Millivolts::new(12_000)).expect("there is a battery");
//! let control = Control::new(1_000);
//! let linear = linear_current(&current, Scheme::B, at, control);
//! assert!(linear.duty > linear_duty(Scheme::B, at, control).duty);
//! ```

use super::Winding;
use super::points::{OperatingPoint, Regime};
use crate::bridge::{BridgeConstants, Timing};
use crate::units::Duty;
use crate::units::single::{at_least, at_most};
use libm::{expm1f, log1pf, roundf, sqrtf};

/// Least ratio `a1 / a0` of the module's formula for a discontinuous current within a tick. For a smaller ratio the
/// formula gives a current that is too large to be discontinuous. Chosen.
const LEAST_REMAINING_SHARE: f32 = 0.02;

/// Constants of a winding and its bridge, prepared for use at every tick.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LinearCurrent {
    /// Drop of a catch diode, in V.
    diode_volts: f32,
    /// `Ron / R2`, limited to 1/4. A usable bridge has less.
    switch_share: f32,
    /// PWM period, in time constants of the winding. `None` if the inductance is unknown, or if the current hardly
    /// changes within a period. Every current is then treated as continuous.
    period: Option<PwmPeriod>,
    /// Shortest off time that the bridge can switch, as a share of the PWM period.
    least_off: f32,
    /// Shortest on time that the bridge can switch, as a share of the PWM period.
    least_on: f32,
    /// Length of the edge at turn-on, as a share of the PWM period.
    turn_on: f32,
    /// Length of the edge at turn-off, as a share of the PWM period.
    turn_off: f32,
}

impl LinearCurrent {
    /// Prepares the constants of a winding and its bridge.
    pub fn new(winding: &Winding, bridge: &BridgeConstants) -> Self {
        let ron = f32::from(bridge.switch_mohm());
        let r2 = f32::from(winding.resistance.as_milliohms()) + 2.0 * ron;
        let share = |ns: u16| f32::from(ns) * 1e-9 * bridge.pwm_hz() as f32;
        let Timing { least_off_ns, least_on_ns, turn_on_ns, turn_off_ns, .. } = bridge.timing;
        Self {
            diode_volts: f32::from(bridge.diode_mv()) / 1000.0,
            switch_share: at_most(ron / r2, 0.25),
            period: winding.inductance.and_then(|inductance| {
                // A period in time constants is R2 / (L f): here 1000 times R2 in mohm, divided by L in uH and f in Hz.
                let frequency = bridge.pwm_hz() as f32;
                PwmPeriod::new(1000.0 * r2 / (f32::from(inductance.as_microhenries()) * frequency))
            }),
            least_off: share(least_off_ns),
            least_on: share(least_on_ns),
            turn_on: share(turn_on_ns),
            turn_off: share(turn_off_ns),
        }
    }

    /// The duty of a regime for a mean current, given as the voltage `w`, in V, or the nearest duty that the bridge's
    /// timing permits.
    pub(super) fn duty(&self, regime: Regime, at: OperatingPoint, w: f32) -> Duty {
        to_duty(self.nearest(self.ideal_duty(regime, at, w)))
    }

    /// The duty of a regime for a mean current, given as the voltage `w`, in V, or the next lower duty that the
    /// bridge's timing permits. The current is never larger.
    pub(super) fn duty_at_most(&self, regime: Regime, at: OperatingPoint, w: f32) -> Duty {
        let duty = self.ideal_duty(regime, at, w);
        let lower = if duty < 1.0 { at_most(duty, 1.0 - self.least_off) } else { duty };
        to_duty(if lower < self.least_on { 0.0 } else { lower })
    }

    /// The duty of a regime for a mean current, given as the voltage `w`, in V, with a bridge that permits any duty.
    fn ideal_duty(&self, regime: Regime, at: OperatingPoint, w: f32) -> f32 {
        if w > 0.0 { self.drive_state(regime, at).duty(w, self.period) } else { 0.0 }
    }

    /// The nearest duty that the bridge's timing permits.
    pub(super) fn feasible(&self, duty: Duty) -> Duty {
        to_duty(self.nearest(duty.to_f32()))
    }

    /// The nearest duty that the bridge's timing permits. The duties 0 and 1 have no edges and are always permitted.
    fn nearest(&self, duty: f32) -> f32 {
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

    /// Mean current of a duty as the voltage `w`, in V: the inverse of [`duty`](Self::duty). Also returns the magnitude
    /// of the change of `w` per change of the back EMF, see [`Modulation::emf_share`](super::Modulation::emf_share).
    pub(super) fn current(&self, regime: Regime, at: OperatingPoint, duty: Duty) -> (f32, f32) {
        self.drive_state(regime, at).current(duty.to_f32(), self.period)
    }

    /// Largest mean current of a regime that is discontinuous, as the voltage `w`, in V.
    pub(super) fn boundary(&self, regime: Regime, at: OperatingPoint) -> f32 {
        self.period.map_or(0.0, |period| self.drive_state(regime, at).boundary(period))
    }

    /// Mean current at the beginning of a tick, as the voltage `w` in V, with which a motor reaches another back EMF by
    /// the tick's end. The formula is that of a discontinuous current. Also returns the
    /// [`boundary`](Self::boundary): the formula is only correct if the current does not exceed the boundary.
    ///
    /// `change` is the change of the back EMF in V. `load` is the current that balances the load, as the voltage `w`:
    /// negative if load and current act in the same direction. `n` is the length of the tick in mechanical time
    /// constants of the motor, above 0. `None` if no current of this regime is discontinuous, if a discontinuous
    /// current cannot reach the back EMF, or if `a1 / a0` would be below [`LEAST_REMAINING_SHARE`].
    pub(super) fn discontinuous_to(
        &self,
        regime: Regime,
        at: OperatingPoint,
        change: f32,
        load: f32,
        n: f32,
    ) -> Option<(f32, f32)> {
        let state = self.drive_state(regime, at);
        let rise = if regime == Regime::Forward { -change } else { change };
        let current = state.discontinuous_to(rise, load, n)?;
        let boundary = state.boundary(self.period?);
        (boundary > 0.0).then_some((current, boundary))
    }

    /// Voltage in V that makes the current of a winding fall while the bridge is open: the bus voltage and the drops of
    /// two diodes.
    pub(super) const fn falling_volts(&self, battery: f32) -> f32 {
        battery + 2.0 * self.diode_volts
    }

    /// The constants of the module's formulas in a regime, and the lengths of the edges.
    const fn drive_state(&self, regime: Regime, at: OperatingPoint) -> DriveState {
        let (e, v) = at.volts();
        let Self { turn_on, turn_off, .. } = *self;
        match regime {
            Regime::Forward => {
                DriveState { a: v - e, c: e + self.diode_volts, k: self.switch_share, turn_on, turn_off }
            }
            Regime::Braking => DriveState {
                a: e,
                c: v + 2.0 * self.diode_volts - e,
                k: 2.0 * self.switch_share,
                turn_on,
                turn_off,
            },
            Regime::Reverse => {
                DriveState { a: v + e, c: self.diode_volts - e, k: self.switch_share, turn_on, turn_off }
            }
        }
    }
}

/// A regime at an operating point, with the symbols of the module.
#[derive(Clone, Copy)]
struct DriveState {
    /// Voltage a of the module's formulas, in V: while the bridge is on, the current approaches `a / R2`.
    a: f32,
    /// Voltage c of the module's formulas, in V: while the bridge is off, the current falls towards `-c / (m R2)`.
    c: f32,
    /// Share of the resistance that is in the circuit only while the bridge is on.
    k: f32,
    /// Length of the edge at turn-on, as a share of the period.
    turn_on: f32,
    /// Length of the edge at turn-off, as a share of the period.
    turn_off: f32,
}

impl DriveState {
    /// Share of the resistance that is in the circuit while the current falls.
    const fn m(self) -> f32 {
        1.0 - self.k
    }

    /// The duty for a mean current `w` above 0, in V.
    fn duty(self, w: f32, period: Option<PwmPeriod>) -> f32 {
        let Self { a, c, k, .. } = self;
        let (part, whole) = (c + self.m() * w, a + c - k * w);
        if part <= 0.0 {
            return 0.0;
        } else if part >= whole {
            return 1.0;
        }
        let continuous = part / whole;
        let compensated = (continuous + self.delay_continuous()).clamp(0.0, 1.0);
        match period {
            Some(period) if w < a && self.may_be_discontinuous(continuous, period) => {
                let most = continuous * period.length;
                let pulse = self.on_time(w * period.length / a, most) / period.length;
                at_most(compensated, pulse + self.delay_discontinuous())
            }
            _ => compensated,
        }
    }

    /// Additional high time of the PWM line, as a share of the period, that compensates the edges of a continuous
    /// current.
    const fn delay_continuous(self) -> f32 {
        (self.turn_on - self.turn_off) / 2.0
    }

    /// Additional high time of the PWM line, as a share of the period, that compensates the edges of a discontinuous
    /// current.
    fn delay_discontinuous(self) -> f32 {
        if self.turn_on == 0.0 && self.turn_off == 0.0 {
            return 0.0;
        }
        self.turn_on * (1.0 - self.a / (2.0 * (self.a + self.c))) - self.turn_off / 2.0
    }

    /// The mean current of a duty, as the voltage `w` in V, and the magnitude of the change of `w` per change of the
    /// back EMF. If the back EMF exceeds the battery voltage (a <= 0), the current is negative and proportional to the
    /// duty.
    fn current(self, duty: f32, period: Option<PwmPeriod>) -> (f32, f32) {
        let Self { a, c, k, .. } = self;
        if a <= 0.0 {
            return (duty * a, duty);
        }
        // A PWM line that does not switch has no edges.
        let switches = duty > 0.0 && duty < 1.0;
        let less = |delay: f32| if switches { (duty - delay).clamp(0.0, 1.0) } else { duty };
        let on = less(self.delay_continuous());
        let continuous = at_least((on * (a + c) - c) / (self.m() + on * k), 0.0);
        match period {
            Some(period) if self.may_be_discontinuous(on, period) => {
                let (q, _) = self.pulse(less(self.delay_discontinuous()) * period.length);
                let discontinuous = q * a / period.length;
                if continuous > discontinuous {
                    (continuous, 1.0)
                } else {
                    (discontinuous, at_most(discontinuous * (1.0 / a + 1.0 / c), 1.0))
                }
            }
            _ => (continuous, 1.0),
        }
    }

    /// False if the current is certainly continuous: if no voltage makes the current fall (c <= 0), or if the duty
    /// exceeds a limit. The exact limit is an on time of `ln(1 + (exp(P / tau) - 1) c / (a + c))` time constants. The
    /// limit used here needs no logarithm, and is larger for periods up to 11 time constants, so the result can be true
    /// for a continuous current. At 20 kHz a period is 0.1 to 1.6 time constants of the catalogue's windings.
    fn may_be_discontinuous(self, duty: f32, period: PwmPeriod) -> bool {
        self.c > 0.0 && duty * (self.a + self.c) < period.growth * self.c
    }

    /// Largest mean current that is discontinuous, as the voltage `w`, in V; 0 where no current is discontinuous.
    fn boundary(self, period: PwmPeriod) -> f32 {
        let Self { a, c, k, .. } = self;
        if a <= 0.0 || c <= 0.0 {
            return 0.0;
        }
        // Above this duty the current is continuous. The on time at this duty is `ln(1 + (exp(P / tau) - 1) c / (a +
        // c))` time constants. For periods up to 11 time constants `growth * length` is `exp(P / tau) - 1`.
        let duty = log1pf(period.growth * period.length * c / (a + c)) / period.length;
        at_least((duty * (a + c) - c) / (self.m() + duty * k), 0.0)
    }

    /// Computes the formula of [`LinearCurrent::discontinuous_to`]. `rise` is the change of `a` within the tick in V,
    /// negative if the current exceeds the load on average.
    fn discontinuous_to(self, rise: f32, load: f32, n: f32) -> Option<f32> {
        let Self { a, c, .. } = self;
        let (a1, c1) = (a + rise, c - rise);
        let stays = c > 0.0 && c1 > 0.0 && a > 0.0 && a1 > LEAST_REMAINING_SHARE * a;
        stays.then(|| {
            let accelerating = a / c * (rise - (a + c) * log1pf(rise / a)) / n;
            accelerating + load * (a * c1) / (a1 * c)
        })
    }

    /// Returns q of the module's formula for an on time x, and the derivative of q with respect to x.
    fn pulse(self, x: f32) -> (f32, f32) {
        let Self { a, c, .. } = self;
        let m = self.m();
        let h = -expm1f(-x);
        let z = m * h * a / c;
        let defect = if z > 0.0 { 1.0 - log1pf(z) / z } else { 0.0 };
        (x - h + h * defect / m, h + (1.0 - h) * z / (1.0 + z) / m)
    }

    /// Solves the module's formula for the on time x of a given q. The result is at most `most`.
    ///
    /// With `r = a / c`, the power series of q in x begins with `x^2/2 (1 + r) (1 - (1 + 2r) x/3)`. Inverted, the
    /// series of x begins with `s + (1 + 2r) s^2/6`, where `s^2 = 2 q / (1 + r)`. The series is exact only for m = 1.
    /// As a first guess it is good enough for every m. A second bound is x <= q + 1. The guess is the smaller value.
    /// One step of Newton's method follows. The error of the duty is then below 3e-4 for periods up to 1.5 time
    /// constants, and below 1e-3 for periods of 4 time constants.
    fn on_time(self, q: f32, most: f32) -> f32 {
        let part = q * self.c / (self.a + self.c);
        let series = sqrtf(2.0 * part) + (2.0 * q - part) / 3.0;
        let upper = at_most(most, q + 1.0);
        let guess = at_most(series, upper);
        let (reached, slope) = self.pulse(guess);
        at_most(at_least(guess + (q - reached) / at_least(slope, f32::MIN_POSITIVE), 0.0), upper)
    }
}

/// Rounds to the nearest duty; the value must be 0 to 1.
fn to_duty(duty: f32) -> Duty {
    Duty::from_bits((32_768.0 * duty + 0.5) as u16)
}

/// A PWM period in winding time constants.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
struct PwmPeriod {
    /// Length of the period, 2^-10 to 127.
    length: f32,
    /// `(exp(length) - 1) / length`, at most 2^12.
    growth: f32,
}

impl PwmPeriod {
    /// Creates a period from its length in winding time constants. A length above 127 is limited to 127, because the
    /// current then follows the switches almost without delay. `None` for a length up to 2^-10, because the current
    /// then hardly changes within a period.
    fn new(length: f32) -> Option<Self> {
        let length = at_most(length, 127.0);
        (length > 1.0 / 1024.0).then(|| Self { length, growth: at_most(expm1f(length) / length, 4096.0) })
    }
}
