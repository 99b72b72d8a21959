//! The periodic steady state: the motor current that repeats in each PWM period at constant speed.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::periodic::Conduction;
//! use motor_hub::model::si::{Hertz, Volts};
//! use motor_hub::model::switching::{Bridge, Circuit, Conditions, Pwm};
//!
//! let circuit = Circuit::new(&characterised("AM 60 A")?, Bridge::IDEAL);
//! let at = Conditions { battery: Volts(12.0), emf: Volts(6.0) };
//! let steady = circuit.steady(Pwm::new(Mode::Cw98, 0.75, Hertz(20_000.0)), at);
//! assert_eq!(steady.conduction, Conduction::Continuous);
//! // The mean current is 0.75 of 12 V minus the back EMF of 6 V, divided by the resistance of the winding.
//! assert!((steady.mean.0 - 3.0 / circuit.r.0).abs() < 1e-3);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::bridge_states::CurrentSign;
use super::numeric::bracketed_zero;
use super::si::{Amps, Seconds};
use super::switching::{Circuit, Conditions, Integrals, Pwm};

/// Kind of conduction: how long current flows in each period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conduction {
    /// Current flows during the whole period. The current may change its sign.
    Continuous,
    /// Current is zero during a part of the period.
    Discontinuous,
    /// Current is zero during the whole period.
    Zero,
}

impl Conduction {
    /// Returns the name in tables: "C", "D" or "zero".
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Continuous => "C",
            Self::Discontinuous => "D",
            Self::Zero => "zero",
        }
    }
}

/// Averages over one period of the periodic steady state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Steady {
    /// Current at the beginning of the period.
    pub start: Amps,
    /// Mean motor current.
    pub mean: Amps,
    /// Root mean square of the motor current.
    pub rms: Amps,
    /// Mean battery current, negative when current returns to the battery.
    pub battery: Amps,
    /// Kind of conduction.
    pub conduction: Conduction,
    /// Integrals over the period, from which the averages are computed.
    pub sums: Integrals,
    /// Length of the period.
    pub period: Seconds,
}

impl Circuit {
    /// Computes the periodic steady state of `pwm`.
    ///
    /// The final current of a period rises with its initial current, with a slope below 1. Therefore there is exactly
    /// one steady state. If the current keeps its sign and the bridge switches in no time, a formula gives the steady
    /// state. Otherwise a root finder gives the steady state, to a few rounding errors of `f64`.
    #[must_use]
    pub fn steady(&self, pwm: Pwm, at: Conditions) -> Steady {
        let run = |start: f64| {
            let mut sums = Integrals::default();
            let end = self.period(pwm, Amps(start), at, &mut sums);
            (end.0, sums)
        };
        let (from_zero, sums) = run(0.0);
        // The current after one period from zero has the sign of the periodic initial current.
        let start = if from_zero > 0.0 {
            self.fixed_point(pwm, at, CurrentSign::Positive)
        } else if from_zero < 0.0 {
            self.fixed_point(pwm, at, CurrentSign::Negative)
        } else {
            return summarise(pwm, 0.0, sums);
        };
        let start = start.unwrap_or_else(|| {
            let bound = self.largest_target(pwm, at).copysign(from_zero);
            bracketed_zero(0.0, bound, |start| run(start).0 - start)
        });
        summarise(pwm, start, run(start).1)
    }

    /// Returns the periodic initial current in A under the assumption that the current keeps `sign`.
    ///
    /// Returns `None` if the current does not keep the sign, or if the bridge needs time to switch.
    fn fixed_point(&self, pwm: Pwm, at: Conditions, sign: CurrentSign) -> Option<f64> {
        if self.bridge.has_slow_edges() {
            return None;
        }
        let period = 1.0 / pwm.frequency.0;
        let on = self.path(pwm.on, sign, at);
        let off = self.path(pwm.off, sign, at);
        let on_exponent = -pwm.duty.clamp(0.0, 1.0) * period / on.tau;
        let off_exponent = -(1.0 - pwm.duty.clamp(0.0, 1.0)) * period / off.tau;
        let start = (off.target * -off_exponent.exp_m1()
            + on.target * -on_exponent.exp_m1() * off_exponent.exp())
            / -(on_exponent + off_exponent).exp_m1();
        let at_switching = start + (on.target - start) * -on_exponent.exp_m1();
        let keeps = |current: f64| match sign {
            CurrentSign::Positive => current >= 0.0,
            CurrentSign::Negative => current <= 0.0,
        };
        (keeps(start) && keeps(at_switching)).then_some(start)
    }

    /// Returns an upper limit for the magnitude of the periodic current, A.
    fn largest_target(&self, pwm: Pwm, at: Conditions) -> f64 {
        let mut largest: f64 = 0.0;
        for state in [pwm.on, pwm.off] {
            for sign in [CurrentSign::Positive, CurrentSign::Negative] {
                largest = largest.max(self.path(state, sign, at).target.abs());
            }
        }
        largest
    }
}

/// Computes the averages of a period with the initial current `start` (A) from the integrals over the period.
fn summarise(pwm: Pwm, start: f64, sums: Integrals) -> Steady {
    let period = 1.0 / pwm.frequency.0;
    let conduction = if sums.square == 0.0 {
        Conduction::Zero
    } else if sums.idle > 1e-12 * period {
        Conduction::Discontinuous
    } else {
        Conduction::Continuous
    };
    Steady {
        start: Amps(start),
        mean: Amps(sums.current / period),
        rms: Amps((sums.square.max(0.0) / period).sqrt()),
        battery: Amps(sums.battery() / period),
        conduction,
        sums,
        period: Seconds(period),
    }
}
