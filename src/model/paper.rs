//! The four schemes of *the paper* in `f64`, without clamping: R. Atkinson, *On Proportional Braking in H Bridges*
//! (2018). The module also computes the change from braking to reverse at point T, and the steady speed of a motor at a
//! duty.
//!
//! A scheme maps control values from `-c_max` to `c_max` to volts (Scheme A) or amperes (Schemes B, C and D). The map
//! is piecewise linear through four points: S (full reverse), T (full dynamic braking), Z (no current), G (full
//! forward). The `x` of a point is its control value, its `y` is in volts or amperes. All formulas are for clockwise
//! rotation. For counter-clockwise rotation use the size of the back EMF and negate both coordinates.
//!
//! ```
//! use motor_hub::model::paper::Scheme;
//! use motor_hub::model::si::{Ohms, Volts};
//! use motor_hub::model::switching::Conditions;
//!
//! // Scheme B at a back EMF of half the battery voltage: T is at a third of the control range below 0.
//! let at = Conditions { battery: Volts(12.0), emf: Volts(6.0) };
//! let points = Scheme::B.points(1.0, Ohms(3.0), at);
//! assert!((points.t.x + 1.0 / 3.0).abs() < 1e-12);
//! assert!((points.t.y + 2.0).abs() < 1e-12);
//! ```

use super::numeric::bracketed_zero;
use super::periodic::{Conduction, Steady};
use super::response::GearedMotor;
use super::si::{Amps, Ohms, RadPerSec, Volts};
use super::switching::{Bridge, Circuit, Conditions, Pwm};

/// Largest relative difference at which back EMF and battery voltage are treated as equal, without unit.
///
/// The value is some 4500 times the resolution of `f64`, so that rounding errors of both voltages count as equal.
const EQUALITY_TOLERANCE: f64 = 1e-12;

/// A scheme of the paper. A is in section 2, B in section 3, C and D are in the revision of 31 August 2018.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// The voltage is linear in the control value.
    A,
    /// The current is linear in the control value, with one slope above 0 and another below 0.
    B,
    /// The current has the same slope for driving and for braking.
    C,
    /// The control values of S and T are interpolated between Schemes B and C.
    D {
        /// Weight of Scheme C, 0 to 1. Scheme D is Scheme B at 0, and Scheme C at 1.
        blend: f64,
    },
}

/// A point of a scheme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Control value of the point. It is infinite for S and T of Schemes C and D if back EMF and battery voltage are
    /// equal, and meaningless if [`Points::valid`] is false.
    pub x: f64,
    /// Voltage in V for Scheme A, current in A for the other schemes.
    pub y: f64,
}

/// The four points of a scheme at one speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Points {
    /// Point S: full reverse.
    pub s: Point,
    /// Point T: full dynamic braking.
    pub t: Point,
    /// Point Z: no current.
    pub z: Point,
    /// Point G: full forward.
    pub g: Point,
    /// Normalised speed: back EMF divided by battery voltage.
    pub u: f64,
    /// True if the points are defined. Scheme C, and D with a blend above 0, are defined for `u` below 1 only.
    pub valid: bool,
}

impl Scheme {
    /// Returns the points of the scheme for control values up to `c_max`. `at.emf` must be at least 0.
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
        let emf_is_battery = (v - e).abs() <= EQUALITY_TOLERANCE * v;
        // Factor of Scheme B's control values of S and T: 1 + blend (rho - 1), with rho = (v + e)/(v - e).
        let stretch = if blend == 0.0 {
            1.0
        } else if emf_is_battery {
            f64::INFINITY
        } else {
            1.0 + blend * 2.0 * e / (v - e)
        };
        Points {
            s: Point { x: -c_max * stretch, y: -(v + e) / r.0 },
            t: Point { x: if e == 0.0 { 0.0 } else { -c_max * e / (v + e) * stretch }, y: -e / r.0 },
            z: Point { x: 0.0, y: 0.0 },
            g: Point { x: c_max, y: (v - e) / r.0 },
            u,
            valid: blend == 0.0 || (u < 1.0 && !emf_is_battery),
        }
    }
}

/// Returns the largest blend of Scheme D with which full dynamic braking stays within the control range.
///
/// `u` is the back EMF divided by the battery voltage, and must be at least 0. The blend is `(1 - u) / (2 u²)`, but at
/// most 1. The blend is 0 if `u` is 1 or more.
#[must_use]
pub fn blend_keeping_t_in_range(u: f64) -> f64 {
    if u >= 1.0 { 0.0 } else { ((1.0 - u) / (2.0 * u * u)).min(1.0) }
}

/// The change from braking to reverse at point T, where the bridge changes from mode 5/0 to mode 6/2. The paper lists
/// this change as its first to-do item.
///
/// Mode 5/0 shorts the motor during the duty, and opens the bridge for the rest of a PWM period. Mode 6/2 drives
/// counter-clockwise during the duty, and then freewheels. At duty 0 mode 6/2 brakes through a switch and a diode, and
/// mode 5/0 at duty 1 through two switches. With ideal switches the braking current of mode 6/2 is therefore smaller by
/// `Vd/R`, and at least 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReverseTransition {
    /// Duty at which mode 6/2 brakes with the current of full dynamic braking.
    pub duty_at_t: f64,
    /// Motor current of mode 6/2 at duty 0.
    pub current: Amps,
    /// Motor current of full dynamic braking.
    pub current_at_t: Amps,
    /// Control value in Scheme A at which the line from S through T, extended, reaches duty 0 of mode 6/2.
    pub control_a: f64,
    /// Control value in Scheme B at which the line from S through T, extended, reaches duty 0 of mode 6/2.
    pub control_b: f64,
    /// Control value of point T in Scheme B.
    pub t_of_b: f64,
    /// Result of the function [`blend_keeping_t_in_range`] at this speed.
    pub blend_keeping_t_in_range: f64,
}

impl Circuit {
    /// Returns the change from braking to reverse at T for control values up to `c_max`. `at.emf` must be at least 0.
    ///
    /// The currents and the duty include the resistance of the switches. The control values are for ideal switches:
    /// `x_T + (x_T - x_S) Vd/Vbat`.
    #[must_use]
    pub fn reverse0(&self, c_max: f64, at: Conditions) -> ReverseTransition {
        let (v, e) = (at.battery.0, at.emf.0);
        let (vd, ron, r) = (self.bridge.vd.0, self.bridge.ron.0, self.r.0);
        // Voltage drop of one switch at full braking. Mode 6/2 has one switch in the current's path, mode 5/0 has two.
        let switch_drop = ron * e / (r + 2.0 * ron);
        let b = Scheme::B.points(c_max, self.r, at);
        ReverseTransition {
            duty_at_t: (vd - switch_drop) / (v + vd - switch_drop),
            current: Amps(-(e - vd).max(0.0) / (r + ron)),
            current_at_t: Amps(-e / (r + 2.0 * ron)),
            control_a: c_max * vd / v,
            control_b: b.t.x + (b.t.x - b.s.x) * vd / v,
            t_of_b: b.t.x,
            blend_keeping_t_in_range: blend_keeping_t_in_range(e / v),
        }
    }
}

impl GearedMotor {
    /// Returns the speed of the motor shaft at which the mean torque of `pwm` balances the drag. No external torque
    /// acts.
    #[must_use]
    pub fn speed_at_duty(&self, bridge: Bridge, pwm: Pwm, battery: Volts) -> RadPerSec {
        // No steady speed is above `fastest`: even an open bridge brakes through its diodes at that speed.
        let fastest = 1.01 * (battery.0 + 2.0 * bridge.vd.0) / self.motor.ke.0;
        let surplus = |speed: f64| {
            let mean = self.steady_pwm(bridge, pwm, RadPerSec(speed), battery).mean.0;
            self.motor.kt.0 * mean - self.shaft.drag.0 * speed
        };
        RadPerSec(bracketed_zero(-fastest, fastest, surplus))
    }

    /// Returns the smallest duty at which current flows during the whole PWM period, at the steady speed of this duty.
    /// `pwm.duty` is ignored.
    ///
    /// Returns `None` if the current is zero for a part of the period even at duty 1.
    #[must_use]
    pub fn continuity_duty(&self, bridge: Bridge, pwm: Pwm, battery: Volts) -> Option<f64> {
        let continuous = |duty: f64| {
            let pwm = Pwm { duty, ..pwm };
            let speed = self.speed_at_duty(bridge, pwm, battery);
            self.steady_pwm(bridge, pwm, speed, battery).conduction == Conduction::Continuous
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

    /// Returns the periodic steady state of the current at a constant speed of the motor shaft.
    fn steady_pwm(&self, bridge: Bridge, pwm: Pwm, speed: RadPerSec, battery: Volts) -> Steady {
        Circuit::new(&self.motor, bridge).steady(pwm, Conditions { battery, emf: self.emf(speed) })
    }
}
