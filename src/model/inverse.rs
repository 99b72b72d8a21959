//! Inverse of the bridge: mode and duty for a requested mean current.
//!
//! A *mode* is a pair of bridge states that alternate in each PWM period. Mode 9/8 drives clockwise and mode 6/2
//! counter-clockwise; both freewheel in the second state. Mode 5/0 shorts the motor, then opens the bridge.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::si::{Amps, Hertz, Volts};
//! use motor_hub::model::switching::{Bridge, Circuit, Conditions};
//!
//! // A current of 0.5 A against the rotation is less than the current of full dynamic braking, so mode 5/0 is chosen.
//! let circuit = Circuit::new(&characterised("AM 60 A")?, Bridge::IDEAL);
//! let at = Conditions { battery: Volts(12.0), emf: Volts(6.0) };
//! let pwm = circuit.duty_for_current(Amps(-0.5), Hertz(20_000.0), at);
//! assert_eq!((pwm.on, pwm.off), (Mode::Brake50.on(), Mode::Brake50.off()));
//! assert!(0.0 < pwm.duty && pwm.duty < 1.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::numeric::bracketed_zero;
use super::si::{Amps, Hertz};
use super::switching::{Circuit, Conditions, Pwm};
use crate::bridge::Mode;

impl Circuit {
    /// Returns the mode for a mean current. *Full dynamic braking* is the current of a motor that is shorted all the
    /// time.
    ///
    /// For clockwise rotation a positive current needs mode 9/8. A negative current needs mode 5/0 up to full dynamic
    /// braking, and mode 6/2 beyond. For counter-clockwise rotation 9/8 and 6/2 are exchanged, and so are the signs.
    #[must_use]
    pub fn mode_for_current(&self, requested: Amps, at: Conditions) -> Mode {
        if at.emf.0 < 0.0 {
            return self.mode_for_current(Amps(-requested.0), mirrored(at)).mirrored();
        }
        let full_braking = -at.emf.0 / (self.r.0 + 2.0 * self.bridge.ron.0);
        if requested.0 > 0.0 {
            Mode::Cw98
        } else if requested.0 >= full_braking {
            Mode::Brake50
        } else {
            Mode::Ccw62
        }
    }

    /// Returns the modulation whose periodic mean current is `requested`, to the precision of `f64`.
    ///
    /// If the mode cannot make this current, the duty is 0 or 1, whichever comes nearer to this current.
    #[must_use]
    pub fn duty_for_current(&self, requested: Amps, frequency: Hertz, at: Conditions) -> Pwm {
        let mode = self.mode_for_current(requested, at);
        let error = |duty: f64| self.steady(Pwm::new(mode, duty, frequency), at).mean.0 - requested.0;
        Pwm::new(mode, bracketed_zero(0.0, 1.0, error), frequency)
    }

    /// Returns the modulation for a mean current by a formula, without simulation of the bridge.
    ///
    /// `|emf|` must be below the battery voltage. The duty differs from the exact duty by less than 0.001 above 15 kHz,
    /// and by less than 0.01 from 1 kHz on. A test checks these limits for each motor of the catalogue, with battery
    /// voltages of 6.5 and 14.5 V, and a back EMF of up to 0.95 times this voltage.
    ///
    /// In continuous conduction the mean terminal voltage is linear in the duty. In discontinuous conduction the
    /// current rises from zero for a time `x`, then falls to zero, with times in units of the electrical time constant.
    /// The charge of this pulse is `a x - c ln(1 + (a/c)(1 - exp(-x)))`, in units of a volt times the time constant
    /// divided by the resistance. Here `a` is the voltage that raises the current and `c` the voltage that lowers it.
    #[must_use]
    pub fn duty_for_current_formula(&self, requested: Amps, frequency: Hertz, at: Conditions) -> Pwm {
        let mode = self.mode_for_current(requested, at);
        if at.emf.0 < 0.0 {
            let mirrored = self.duty_for_current_formula(Amps(-requested.0), frequency, mirrored(at));
            return Pwm::new(mode, mirrored.duty, frequency);
        }
        let (i, v, e) = (requested.0, at.battery.0, at.emf.0);
        let (r, ron, vd) = (self.r.0, self.bridge.ron.0, self.bridge.vd.0);
        let duty = match mode {
            Mode::Cw98 => {
                let continuous = (e + vd + i * (r + ron)) / (v + vd - i * ron);
                self.discontinuous(i, v - e, e + vd, r + 1.5 * ron, frequency).unwrap_or(continuous)
            }
            Mode::Brake50 => {
                let continuous = (v + 2.0 * vd - e - r * i) / (v + 2.0 * vd + 2.0 * ron * i);
                let fall = v + 2.0 * vd - e;
                self.discontinuous(i, e, fall, r + ron, frequency).unwrap_or(continuous)
            }
            Mode::Ccw62 => {
                let continuous = (vd - e - i * (r + ron)) / (v + vd + i * ron);
                // A back EMF below the diode drop cannot keep current flowing between two pulses.
                self.discontinuous(i, v + e, vd - e, r + 1.5 * ron, frequency).unwrap_or(continuous)
            }
        };
        Pwm::new(mode, duty.clamp(0.0, 1.0), frequency)
    }

    /// Returns the duty of discontinuous conduction for a mean current of magnitude `|i|`.
    ///
    /// `rise` and `fall` are the voltages in V that raise and lower the current, and `r` is the resistance of its path
    /// in ohm. `None` if the current would not return to zero within the period.
    fn discontinuous(&self, i: f64, rise: f64, fall: f64, r: f64, frequency: Hertz) -> Option<f64> {
        if i == 0.0 {
            return Some(0.0);
        }
        if rise <= 0.0 || fall <= 0.0 {
            return None;
        }
        let periods = r / (self.l.0 * frequency.0);
        let ratio = rise / fall;
        let charge = r * i.abs() * periods;
        let fall_time = |x: f64| (ratio * -(-x).exp_m1()).ln_1p();
        // Newton's method. The charge is convex in x, and the first estimate comes from the leading term of the charge.
        // After any estimate the next estimate is above the root, so all later estimates approach the root from above.
        let mut x = (2.0 * charge / (rise * (1.0 + ratio))).sqrt();
        for _ in 0..60 {
            let decay = (-x).exp();
            let slope = rise - rise * decay / (1.0 + ratio * (1.0 - decay));
            let step = (rise * x - fall * fall_time(x) - charge) / slope;
            x -= step;
            if step.abs() <= 1e-14 * x {
                break;
            }
        }
        (x + fall_time(x) < periods).then_some(x / periods)
    }
}

/// Returns the conditions of a motor that turns in the other direction at the same speed.
fn mirrored(at: Conditions) -> Conditions {
    Conditions { emf: super::si::Volts(-at.emf.0), ..at }
}
