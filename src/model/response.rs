//! Response of a geared motor to a constant voltage, in closed form. The source is *the paper*: R. Atkinson, *On
//! Proportional Braking in H Bridges* (2018), sections 2.2.2 and 2.2.3.
//!
//! ```text
//! L i' + R i + Ke w = v
//! Jt w' + Bt w = Kt i + tau / (eta N)
//! ```
//!
//! Here `i` is the motor current, `w` the speed of the motor shaft, `v` the voltage, and `tau` the external torque on
//! the output shaft. `R`, `L`, `Ke` and `Kt` are the constants of the motor, `eta` and `N` efficiency and ratio of its
//! gearbox. `Jt` and `Bt` are inertia and drag of motor and load on the motor shaft. `A` is the matrix of both
//! equations.
//!
//! With `D0 = R Bt + Ke Kt`, `sigma = (R/L + Bt/Jt)/2` and `gamma2 = sigma² - D0/(L Jt)` the poles are
//! `-sigma ± sqrt(gamma2)`. Within `t` a deviation from the steady state is multiplied by
//! `exp(-sigma t) (C + S (A + sigma))`. There `g = sqrt(gamma2)`, `C = cosh(g t)` and `S = sinh(g t)/g`.
//!
//! The code combines the exponentials so that no intermediate result overflows. All formulas of the code are valid for
//! equal poles too, where `g` is 0.
//!
//! ```
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::response::{Applied, GearedMotor, Motion};
//! use motor_hub::model::si::{Seconds, Volts};
//!
//! // One minute after a start at 12 V the motor has its steady speed.
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

/// Voltage and external torque of a motor, both constant during a calculation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Applied {
    /// Voltage at the terminals.
    pub voltage: Volts,
    /// Whole external torque on the output shaft, positive when it drives clockwise. The constant torque of [`Load`] is
    /// not added.
    pub torque_after: NewtonMetres,
}

impl Applied {
    /// Applies a voltage without external torque.
    #[must_use]
    pub const fn voltage(voltage: Volts) -> Self {
        Self { voltage, torque_after: NewtonMetres(0.0) }
    }
}

/// The poles of motor and load, 1/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Poles {
    /// The poles are real: `-slow` and `-fast`. The poles may be equal.
    Real {
        /// Magnitude of the pole nearer to 0, 1/s.
        slow: f64,
        /// Magnitude of the pole farther from 0, 1/s.
        fast: f64,
    },
    /// The poles are complex: `-decay ± i frequency`.
    Complex {
        /// Magnitude of the real part, 1/s.
        decay: f64,
        /// Magnitude of the imaginary part, rad/s.
        frequency: f64,
    },
}

/// A motor with its load, described by its response at the motor terminals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GearedMotor {
    pub(super) motor: Motor,
    pub(super) shaft: Shaft,
}

/// Response of a motor at steady speed to a drop of its voltage, over one control period (paper, sections 2.2.2 and
/// 2.2.3).
///
/// Two drops are computed. `mean_current` and `end_current` are for a drop to the back EMF. Fields that begin with
/// `mean_zero` are for the drop after which the mean current over the period is 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoltageDrop {
    /// Voltage that keeps the speed before the drop.
    pub before: Volts,
    /// Back EMF at the steady speed.
    pub emf: Volts,
    /// Current that keeps the speed before the drop.
    pub current_before: Amps,
    /// Mean current over the period after a drop to the back EMF.
    pub mean_current: Amps,
    /// Current at the end of the period after a drop to the back EMF.
    pub end_current: Amps,
    /// Change of the voltage after which the mean current over the period is 0.
    pub mean_zero_change: Volts,
    /// Voltage after the change `mean_zero_change`.
    pub mean_zero_voltage: Volts,
    /// Speed of the motor shaft at the end of a period at `mean_zero_voltage`.
    pub mean_zero_end_speed: RadPerSec,
}

impl GearedMotor {
    /// Combines a motor with a load.
    #[must_use]
    pub fn new(motor: &Motor, load: &Load) -> Self {
        Self { motor: *motor, shaft: Shaft::new(motor, load) }
    }

    /// Returns inertia and drag of motor and load on the motor shaft.
    #[must_use]
    pub const fn shaft(&self) -> &Shaft {
        &self.shaft
    }

    /// Returns `R Bt + Ke Kt`, ohm N m s/rad.
    fn d0(&self) -> f64 {
        self.motor.r.0 * self.shaft.drag.0 + self.motor.ke.0 * self.motor.kt.0
    }

    /// Returns the mean of the magnitudes of real poles, or the decay of complex poles, 1/s.
    #[must_use]
    pub fn sigma(&self) -> f64 {
        0.5 * (self.motor.r.0 / self.motor.l.0 + self.shaft.drag.0 / self.shaft.inertia.0)
    }

    /// Returns half the difference between the electrical rate `R/L` and the mechanical rate `Bt/Jt`, 1/s.
    fn half_difference(&self) -> f64 {
        0.5 * (self.motor.r.0 / self.motor.l.0 - self.shaft.drag.0 / self.shaft.inertia.0)
    }

    /// Returns the square of half the distance between the poles, 1/s². The square is negative if the poles are
    /// complex.
    #[must_use]
    pub fn gamma2(&self) -> f64 {
        // This is equal to sigma² - D0/(L Jt), with less cancellation.
        self.half_difference().powi(2)
            - self.motor.ke.0 * self.motor.kt.0 / (self.motor.l.0 * self.shaft.inertia.0)
    }

    /// Returns the poles.
    #[must_use]
    pub fn poles(&self) -> Poles {
        let (sigma, gamma2) = (self.sigma(), self.gamma2());
        if gamma2 < 0.0 {
            return Poles::Complex { decay: sigma, frequency: (-gamma2).sqrt() };
        }
        let fast = sigma + gamma2.sqrt();
        // The slow pole follows from the product of the poles, because sigma - g would lose digits.
        let product = self.d0() / (self.motor.l.0 * self.shaft.inertia.0);
        Poles::Real { slow: product / fast, fast }
    }

    /// Returns the mechanical time constant without inductance, `R Jt / D0`.
    #[must_use]
    pub fn tau_m(&self) -> Seconds {
        Seconds(self.motor.r.0 * self.shaft.inertia.0 / self.d0())
    }

    /// Returns the electrical time constant, `L / R`.
    #[must_use]
    pub fn tau_e(&self) -> Seconds {
        Seconds(self.motor.l.0 / self.motor.r.0)
    }

    /// Returns the back EMF at a speed of the motor shaft.
    #[must_use]
    pub fn emf(&self, speed: RadPerSec) -> Volts {
        Volts(self.motor.ke.0 * speed.0)
    }

    /// Returns steady current and steady speed. Without external torque these are no-load current and free speed.
    #[must_use]
    pub fn steady(&self, applied: Applied) -> Motion {
        let (v, torque) = (applied.voltage.0, applied.torque_after.0 * self.shaft.torque_ratio);
        let d0 = self.d0();
        Motion {
            current: Amps((self.shaft.drag.0 * v - self.motor.ke.0 * torque) / d0),
            speed: RadPerSec((self.motor.kt.0 * v + self.motor.r.0 * torque) / d0),
        }
    }

    /// Returns the voltage that keeps a speed against drag and external torque.
    #[must_use]
    pub fn steady_voltage(&self, speed: RadPerSec, torque_after: NewtonMetres) -> Volts {
        let torque = torque_after.0 * self.shaft.torque_ratio;
        Volts((self.d0() * speed.0 - self.motor.r.0 * torque) / self.motor.kt.0)
    }

    /// Returns `exp(-sigma t) C - 1` and `exp(-sigma t) S`.
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

    /// Returns the changes of current (A) and speed (rad/s) within `t` seconds.
    fn change(&self, start: Motion, applied: Applied, t: f64) -> (f64, f64) {
        let steady = self.steady(applied);
        let current = start.current.0 - steady.current.0;
        let speed = start.speed.0 - steady.speed.0;
        let (cosine, sine) = self.propagator(t);
        let half = self.half_difference();
        (
            cosine * current - sine * (half * current + self.motor.ke.0 / self.motor.l.0 * speed),
            cosine * speed + sine * (self.motor.kt.0 / self.shaft.inertia.0 * current + half * speed),
        )
    }

    /// Returns current and speed after `time`, at least 0, from any initial state.
    #[must_use]
    pub fn after(&self, start: Motion, applied: Applied, time: Seconds) -> Motion {
        let (current, speed) = self.change(start, applied, time.0);
        Motion { current: Amps(start.current.0 + current), speed: RadPerSec(start.speed.0 + speed) }
    }

    /// Returns the exact mean of current and speed over `time`, above 0, from any initial state.
    ///
    /// The mean is `x_ss + A⁻¹ (x(P) - x(0)) / P`, the integral of the differential equation. `x` is the state, `x_ss`
    /// the steady state and `P` the time.
    #[must_use]
    pub fn mean(&self, start: Motion, applied: Applied, time: Seconds) -> Motion {
        let steady = self.steady(applied);
        let (current, speed) = self.change(start, applied, time.0);
        let Motor { r, l, ke, kt, .. } = self.motor;
        let (inertia, drag) = (self.shaft.inertia.0, self.shaft.drag.0);
        let scale = 1.0 / (self.d0() * time.0);
        Motion {
            current: Amps(steady.current.0 + scale * (ke.0 * inertia * speed - drag * l.0 * current)),
            speed: RadPerSec(steady.speed.0 - scale * (kt.0 * l.0 * current + r.0 * inertia * speed)),
        }
    }

    /// Returns the response to a drop of the voltage at steady `speed`, over one control period.
    #[must_use]
    pub fn voltage_drop(&self, speed: RadPerSec, period: Seconds) -> VoltageDrop {
        let before = self.steady_voltage(speed, NewtonMetres(0.0));
        let emf = self.emf(speed);
        let start = self.steady(Applied::voltage(before));
        let dropped = Applied::voltage(emf);
        // The mean current is linear in the change of the voltage. Its slope is the response to 1 V.
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

    /// Returns the present current without inductance, `(v - Ke w) / R`. The paper uses this current as the mean
    /// current.
    #[must_use]
    pub fn quasistatic_current(&self, speed: RadPerSec, voltage: Volts) -> Amps {
        Amps((voltage.0 - self.motor.ke.0 * speed.0) / self.motor.r.0)
    }

    /// Estimates the mean current over a control period, without external torque.
    ///
    /// Without inductance the mean is `i_inf + (i_q - i_inf) phi`: `i_inf` is the steady current, `i_q` the quasistatic
    /// current and `phi` the mean of `exp(-t/tau_m)`. The term `(i0 - i_q) tau_e / P` adds the electrical transient
    /// from the initial current `i0`. The estimate is good if `tau_e` is far below both `tau_m` and the period `P`.
    #[must_use]
    pub fn mean_current_estimate(&self, start: Motion, voltage: Volts, period: Seconds) -> Amps {
        let phi = phi1(period.0 / self.tau_m().0);
        let steady = self.steady(Applied::voltage(voltage)).current.0;
        let quasistatic = self.quasistatic_current(start.speed, voltage).0;
        let electrical = (start.current.0 - quasistatic) * self.tau_e().0 / period.0;
        Amps(steady + (quasistatic - steady) * phi + electrical)
    }
}
