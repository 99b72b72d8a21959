//! The geared motor at a constant voltage, in closed form (paper, sections 2.2.2 and 2.2.3).
//!
//! ```text
//! L i' + R i + Ke w = v
//! Jt w' + Bt w = Kt i + tau / (eta N)
//! ```
//!
//! With `D0 = R Bt + Ke Kt`, `sigma = (R/L + Bt/Jt)/2` and `gamma2 = sigma² - D0/(L Jt)` the poles
//! are `-sigma ± sqrt(gamma2)`, and deviations from the steady state propagate with
//! `exp(-sigma t) (C + S (A + sigma))`, `C = cosh(g t)`, `S = sinh(g t)/g`, `g = sqrt(gamma2)`.
//! The exponentials are combined so that nothing overflows at any time, and each form has its limit
//! at `g = 0`, so that equal poles need no case of their own.
//!
//! ```
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::response::{Applied, GearedMotor, Motion};
//! use motor_hub::model::si::{Seconds, Volts};
//!
//! // From rest at 12 V; after a minute it runs as fast as it ever will.
//! let motor = GearedMotor::new(&characterised("AM 60 A")?, &Load::NONE);
//! let applied = Applied::voltage(Volts(12.0));
//! let after = motor.after(Motion::default(), applied, Seconds(60.0));
//! assert!((after.speed.0 / motor.steady(applied).speed.0 - 1.0).abs() < 1e-9);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::catalogue::Motor;
use super::load::{Load, Shaft};
use super::numeric::phi1;
use super::si::{Amps, NewtonMetres, RadPerSec, Seconds, Volts};

/// Motor current and the speed of the motor shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Motor current.
    pub current: Amps,
    /// Speed of the motor shaft.
    pub speed: RadPerSec,
}

/// What acts on the motor from outside, constant for the while.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Applied {
    /// Voltage at the terminals.
    pub voltage: Volts,
    /// External torque on the output shaft, positive when it drives clockwise. It is the whole
    /// torque: the constant part in [`Load`] is not added.
    pub torque_after: NewtonMetres,
}

impl Applied {
    /// A voltage without external torque.
    #[must_use]
    pub const fn voltage(voltage: Volts) -> Self {
        Self { voltage, torque_after: NewtonMetres(0.0) }
    }
}

/// The poles of motor and load, 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Poles {
    /// Two real poles, or one twice: `-slow` and `-fast`.
    Real {
        /// Size of the pole nearer to 0.
        slow: f64,
        /// Size of the other one.
        fast: f64,
    },
    /// `-decay ± i frequency`.
    Complex {
        /// Size of the real part.
        decay: f64,
        /// Size of the imaginary part, rad/s.
        frequency: f64,
    },
}

/// A motor with its load, seen from the motor's terminals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GearedMotor {
    motor: Motor,
    shaft: Shaft,
}

/// What a drop of the voltage to the back EMF does to a motor that ran steadily (paper, sections 2.2.2
/// and 2.2.3).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltageDrop {
    /// Voltage that kept the speed.
    pub before: Volts,
    /// Back EMF at that speed.
    pub emf: Volts,
    /// Current that kept the speed.
    pub current_before: Amps,
    /// Mean current over the period after the voltage dropped to the back EMF.
    pub mean_current: Amps,
    /// Current at the end of that period.
    pub end_current: Amps,
    /// Change of voltage after which the mean current over the period is 0.
    pub mean_zero_change: Volts,
    /// Voltage after that change.
    pub mean_zero_voltage: Volts,
    /// Speed of the motor shaft at the end of that period.
    pub mean_zero_end_speed: RadPerSec,
}

impl GearedMotor {
    /// The motor with this load.
    #[must_use]
    pub fn new(motor: &Motor, load: &Load) -> Self {
        Self { motor: *motor, shaft: Shaft::new(motor, load) }
    }

    /// Inertia and drag of motor and load on the motor shaft.
    #[must_use]
    pub const fn shaft(&self) -> &Shaft {
        &self.shaft
    }

    /// `R Bt + Ke Kt`, ohm N m s/rad.
    fn d0(&self) -> f64 {
        self.motor.r.0 * self.shaft.drag.0 + self.motor.ke.0 * self.motor.kt.0
    }

    /// Mean of the two poles' sizes, 1/s.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        0.5 * (self.motor.r.0 / self.motor.l.0 + self.shaft.drag.0 / self.shaft.inertia.0)
    }

    /// Half the difference of the electrical and the mechanical rate, 1/s.
    fn half_difference(&self) -> f64 {
        0.5 * (self.motor.r.0 / self.motor.l.0 - self.shaft.drag.0 / self.shaft.inertia.0)
    }

    /// Square of half the poles' distance, 1/s²; negative if the motor oscillates.
    #[must_use]
    pub fn gamma2(&self) -> f64 {
        // Equal to sigma² - D0/(L Jt), with less cancellation.
        self.half_difference().powi(2)
            - self.motor.ke.0 * self.motor.kt.0 / (self.motor.l.0 * self.shaft.inertia.0)
    }

    /// The poles.
    #[must_use]
    pub fn poles(&self) -> Poles {
        let (sigma, gamma2) = (self.sigma(), self.gamma2());
        if gamma2 < 0.0 {
            return Poles::Complex { decay: sigma, frequency: (-gamma2).sqrt() };
        }
        let fast = sigma + gamma2.sqrt();
        // Their product is known, which saves the slow pole from sigma - g.
        let product = self.d0() / (self.motor.l.0 * self.shaft.inertia.0);
        Poles::Real { slow: product / fast, fast }
    }

    /// Mechanical time constant with the inductance neglected, `R Jt / D0`.
    #[must_use]
    pub fn tau_m(&self) -> Seconds {
        Seconds(self.motor.r.0 * self.shaft.inertia.0 / self.d0())
    }

    /// Electrical time constant, `L / R`.
    #[must_use]
    pub fn tau_e(&self) -> Seconds {
        Seconds(self.motor.l.0 / self.motor.r.0)
    }

    /// Back EMF at a speed of the motor shaft.
    #[must_use]
    pub fn emf(&self, speed: RadPerSec) -> Volts {
        Volts(self.motor.ke.0 * speed.0)
    }

    /// Where the motor settles: free speed and no-load current, if there is no torque.
    #[must_use]
    pub fn steady(&self, applied: Applied) -> Motion {
        let (v, torque) = (applied.voltage.0, applied.torque_after.0 * self.shaft.torque_ratio);
        let d0 = self.d0();
        Motion {
            current: Amps((self.shaft.drag.0 * v - self.motor.ke.0 * torque) / d0),
            speed: RadPerSec((self.motor.kt.0 * v + self.motor.r.0 * torque) / d0),
        }
    }

    /// The voltage that keeps a speed against drag and external torque.
    #[must_use]
    pub fn steady_voltage(&self, speed: RadPerSec, torque_after: NewtonMetres) -> Volts {
        let torque = torque_after.0 * self.shaft.torque_ratio;
        Volts((self.d0() * speed.0 - self.motor.r.0 * torque) / self.motor.kt.0)
    }

    /// `exp(-sigma t) C - 1` and `exp(-sigma t) S`.
    fn propagator(&self, t: f64) -> (f64, f64) {
        match self.poles() {
            Poles::Real { slow, fast } => (
                0.5 * ((-slow * t).exp_m1() + (-fast * t).exp_m1()),
                (-slow * t).exp() * t * phi1((fast - slow) * t),
            ),
            Poles::Complex { decay, frequency } => {
                let (angle, envelope) = (frequency * t, (-decay * t).exp());
                let half = (0.5 * angle).sin();
                let sine = if angle == 0.0 { t } else { t * (angle.sin() / angle) };
                ((-decay * t).exp_m1() - 2.0 * envelope * half * half, envelope * sine)
            }
        }
    }

    /// Change of current and speed within `t`.
    fn change(&self, start: Motion, applied: Applied, t: f64) -> (f64, f64) {
        let settled = self.steady(applied);
        let current = start.current.0 - settled.current.0;
        let speed = start.speed.0 - settled.speed.0;
        let (cosine, sine) = self.propagator(t);
        let half = self.half_difference();
        (
            cosine * current - sine * (half * current + self.motor.ke.0 / self.motor.l.0 * speed),
            cosine * speed + sine * (self.motor.kt.0 / self.shaft.inertia.0 * current + half * speed),
        )
    }

    /// Current and speed after `time` of at least 0 from any state.
    #[must_use]
    pub fn after(&self, start: Motion, applied: Applied, time: Seconds) -> Motion {
        let (current, speed) = self.change(start, applied, time.0);
        Motion { current: Amps(start.current.0 + current), speed: RadPerSec(start.speed.0 + speed) }
    }

    /// Exact mean of current and speed over `time`, above 0, from any state.
    ///
    /// `x_ss + A⁻¹ (x(P) - x(0)) / P`: the differential equation itself, integrated.
    #[must_use]
    pub fn mean(&self, start: Motion, applied: Applied, time: Seconds) -> Motion {
        let settled = self.steady(applied);
        let (current, speed) = self.change(start, applied, time.0);
        let Motor { r, l, ke, kt, .. } = self.motor;
        let (inertia, drag) = (self.shaft.inertia.0, self.shaft.drag.0);
        let scale = 1.0 / (self.d0() * time.0);
        Motion {
            current: Amps(settled.current.0 + scale * (ke.0 * inertia * speed - drag * l.0 * current)),
            speed: RadPerSec(settled.speed.0 - scale * (kt.0 * l.0 * current + r.0 * inertia * speed)),
        }
    }

    /// Drops of the voltage from what keeps `speed`, over one control period.
    #[must_use]
    pub fn voltage_drop(&self, speed: RadPerSec, period: Seconds) -> VoltageDrop {
        let before = self.steady_voltage(speed, NewtonMetres(0.0));
        let emf = self.emf(speed);
        let start = self.steady(Applied::voltage(before));
        let dropped = Applied::voltage(emf);
        // The mean is linear in the change of voltage, with the response to one volt as its slope.
        let one_volt = Applied::voltage(Volts(1.0));
        let slope = self.mean(Motion::default(), one_volt, period).current.0;
        let change = -start.current.0 / slope;
        let mean_zero_voltage = Volts(before.0 + change);
        VoltageDrop {
            before,
            emf,
            current_before: start.current,
            mean_current: self.mean(start, dropped, period).current,
            end_current: self.after(start, dropped, period).current,
            mean_zero_change: Volts(change),
            mean_zero_voltage,
            mean_zero_end_speed: self.after(start, Applied::voltage(mean_zero_voltage), period).speed,
        }
    }

    /// The current that the paper takes for the mean: `(v - Ke w) / R`, of the instant.
    #[must_use]
    pub fn quasistatic_current(&self, speed: RadPerSec, voltage: Volts) -> Amps {
        Amps((voltage.0 - self.motor.ke.0 * speed.0) / self.motor.r.0)
    }

    /// Estimate of the mean current over a control period, without external torque.
    ///
    /// The motor without inductance gives `i_inf + (i_q - i_inf) phi`, `phi` being the mean of
    /// `exp(-t/tau_m)`; `(i0 - i_q) tau_e / P` adds the electrical transient. Good where
    /// `tau_e` is far below `tau_m` and the period.
    #[must_use]
    pub fn mean_current_estimate(&self, start: Motion, voltage: Volts, period: Seconds) -> Amps {
        let phi = phi1(period.0 / self.tau_m().0);
        let settled = self.steady(Applied::voltage(voltage)).current.0;
        let instant = self.quasistatic_current(start.speed, voltage).0;
        let electrical = (start.current.0 - instant) * self.tau_e().0 / period.0;
        Amps(settled + (instant - settled) * phi + electrical)
    }
}
