//! The paper's four schemes in `f64`, unclamped, and what follows from them and the bridge:
//! where full braking ends, and how fast a motor runs at a duty.
//!
//! A scheme maps a control value from `-c_max` to `c_max` through four points: S (full reverse),
//! T (full dynamic braking), Z (no current), G (full forward). Abscissas are control values,
//! ordinates volts in Scheme A and amperes in the others. All formulas are for clockwise rotation;
//! for the other direction take the size of the back EMF and negate both coordinates.
//!
//! ```
//! use motor_hub::model::paper::Scheme;
//! use motor_hub::model::si::{Ohms, Volts};
//! use motor_hub::model::switching::Conditions;
//!
//! // Scheme B at half of the free speed: full dynamic braking a third of the way to full reverse.
//! let at = Conditions { battery: Volts(12.0), emf: Volts(6.0) };
//! let points = Scheme::B.points(1.0, Ohms(3.0), at);
//! assert!((points.t.x + 1.0 / 3.0).abs() < 1e-12);
//! assert!((points.t.y + 2.0).abs() < 1e-12);
//! ```

use super::catalogue::Motor;
use super::load::{Load, Shaft};
use super::numeric::bracketed_zero;
use super::periodic::Conduction;
use super::si::{Amps, Ohms, RadPerSec, Volts};
use super::switching::{Bridge, Circuit, Conditions, Pwm};

/// Relative distance of the back EMF from the battery's voltage that counts as equality.
const MEETING: f64 = 1e-12;

/// A scheme of the paper: A in section 2, B in section 3, C and D in the revision of 31 August 2018.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// Voltage linear in the control value.
    A,
    /// Current linear in the control value, on each side of zero.
    B,
    /// Current with one slope through braking and driving.
    C,
    /// A blend of B (0) and C (1).
    D {
        /// The share of C.
        blend: f64,
    },
}

/// A point of a scheme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Control value; infinite where the scheme has no such point.
    pub x: f64,
    /// Volts in Scheme A, amperes in the others.
    pub y: f64,
}

/// The four points of a scheme at one speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Points {
    /// Full reverse.
    pub s: Point,
    /// Full dynamic braking.
    pub t: Point,
    /// No current.
    pub z: Point,
    /// Full forward.
    pub g: Point,
    /// Normalised speed: back EMF over battery voltage.
    pub u: f64,
    /// False where the points mean nothing: C and D from `u = 1` on.
    pub valid: bool,
}

impl Scheme {
    /// The points for control values up to `c_max`; `at.emf` at least 0.
    #[must_use]
    pub fn points(self, c_max: f64, r: Ohms, at: Conditions) -> Points {
        let (v, e) = (at.battery.0, at.emf.0);
        let u = e / v;
        if self == Self::A {
            return Points {
                s: Point { x: -c_max, y: -v },
                t: Point { x: 0.0, y: 0.0 },
                z: Point { x: c_max * u, y: e },
                g: Point { x: c_max, y: v },
                u,
                valid: true,
            };
        }
        let blend = match self {
            Self::A | Self::B => 0.0,
            Self::C => 1.0,
            Self::D { blend } => blend,
        };
        let meets = (v - e).abs() <= MEETING * v;
        let stretch = if blend == 0.0 {
            1.0
        } else if meets {
            f64::INFINITY
        } else {
            // 1 + blend (rho - 1), rho = (v + e)/(v - e).
            1.0 + blend * 2.0 * e / (v - e)
        };
        Points {
            s: Point { x: -c_max * stretch, y: -(v + e) / r.0 },
            t: Point { x: if e == 0.0 { 0.0 } else { -c_max * e / (v + e) * stretch }, y: -e / r.0 },
            z: Point { x: 0.0, y: 0.0 },
            g: Point { x: c_max, y: (v - e) / r.0 },
            u,
            valid: blend == 0.0 || (u < 1.0 && !meets),
        }
    }
}

/// The largest blend of Scheme D with which full dynamic braking stays within the control range:
/// `(1 - u) / (2 u²)`, at most 1; 0 from `u = 1` on. `u` at least 0.
#[must_use]
pub fn blend_keeping_t_in_range(u: f64) -> f64 {
    if u >= 1.0 { 0.0 } else { ((1.0 - u) / (2.0 * u * u)).min(1.0) }
}

/// The crossing from braking to reverse at point T, where a diode takes over from a switch
/// (the paper's first to-do item).
///
/// 6/2 at duty 0 brakes through one diode and so by `Vd/R` less than 5/0 at duty 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reverse0 {
    /// Duty of 6/2 that continues full dynamic braking exactly.
    pub duty_at_t: f64,
    /// Current of 6/2 at duty 0.
    pub current: Amps,
    /// Current of full dynamic braking.
    pub current_at_t: Amps,
    /// Control value of 6/2 at duty 0 on the extended line from S through T, Scheme A.
    pub control_a: f64,
    /// The same for Scheme B.
    pub control_b: f64,
    /// Control value of point T in Scheme B.
    pub t_of_b: f64,
    /// The blend up to which Scheme D keeps T in range at this speed.
    pub blend_keeping_t_in_range: f64,
}

impl Circuit {
    /// The crossing at T for control values up to `c_max`; `at.emf` at least 0.
    ///
    /// The currents and the duty take the switches' resistance into account; the control values are
    /// those of the ideal switch, `x_T + (x_T - x_S) Vd/Vbat`.
    #[must_use]
    pub fn reverse0(&self, c_max: f64, at: Conditions) -> Reverse0 {
        let (v, e) = (at.battery.0, at.emf.0);
        let (vd, ron, r) = (self.bridge.vd.0, self.bridge.ron.0, self.r.0);
        // What one switch drops at full braking: 6/2 has one in its path where 5/0 has two.
        let switch = ron * e / (r + 2.0 * ron);
        let b = Scheme::B.points(c_max, self.r, at);
        Reverse0 {
            duty_at_t: (vd - switch) / (v + vd - switch),
            current: Amps(-(e - vd).max(0.0) / (r + ron)),
            current_at_t: Amps(-e / (r + 2.0 * ron)),
            control_a: c_max * vd / v,
            control_b: b.t.x + (b.t.x - b.s.x) * vd / v,
            t_of_b: b.t.x,
            blend_keeping_t_in_range: blend_keeping_t_in_range(e / v),
        }
    }
}

/// A motor that runs at a fixed duty until its torque balances drag and external torque.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpenLoop {
    motor: Motor,
    shaft: Shaft,
    /// External torque on the motor shaft.
    torque: f64,
    circuit: Circuit,
}

impl OpenLoop {
    /// The motor with its load, the load's constant torque included.
    #[must_use]
    pub fn new(motor: &Motor, load: &Load, bridge: Bridge) -> Self {
        let shaft = Shaft::new(motor, load);
        let torque = load.torque_after.0 * shaft.torque_ratio;
        Self { motor: *motor, shaft, torque, circuit: Circuit::new(motor, bridge) }
    }

    /// Conditions at a motor speed.
    fn at(&self, speed: f64, battery: Volts) -> Conditions {
        Conditions { battery, emf: Volts(self.motor.ke.0 * speed) }
    }

    /// Speed of the motor shaft at which the mean torque of `pwm` balances drag and external torque.
    #[must_use]
    pub fn steady_speed(&self, pwm: Pwm, battery: Volts) -> RadPerSec {
        let Bridge { vd, ron, .. } = self.circuit.bridge;
        // Even an open bridge brakes with the external torque at this speed, through its diodes.
        let resistance = self.motor.r.0 + 2.0 * ron.0;
        let limit = battery.0 + 2.0 * vd.0 + self.torque.abs() * resistance / self.motor.kt.0;
        let fastest = 1.01 * limit / self.motor.ke.0;
        let surplus = |speed: f64| {
            let mean = self.circuit.steady(pwm, self.at(speed, battery)).mean.0;
            self.motor.kt.0 * mean + self.torque - self.shaft.drag.0 * speed
        };
        RadPerSec(bracketed_zero(-fastest, fastest, surplus))
    }

    /// The duty from which on the current at steady speed does not rest at zero any more, or `None`
    /// if it still does at duty 1. `pwm.duty` is ignored.
    #[must_use]
    pub fn continuity_duty(&self, pwm: Pwm, battery: Volts) -> Option<f64> {
        let continuous = |duty: f64| {
            let pwm = Pwm { duty, ..pwm };
            let at = self.at(self.steady_speed(pwm, battery).0, battery);
            self.circuit.steady(pwm, at).conduction == Conduction::Continuous
        };
        if !continuous(1.0) {
            return None;
        }
        let (mut below, mut above) = (0.0, 1.0);
        while above - below > 1e-13 {
            let middle = f64::midpoint(below, above);
            if continuous(middle) {
                above = middle;
            } else {
                below = middle;
            }
        }
        Some(above)
    }
}
