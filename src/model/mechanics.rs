//! Mechanical part of a plant: the exact motion of a shaft during one window of constant torque.
//!
//! A *window* is one time step of the simulation. The shaft follows `J w' + B w = torque - friction`, with its speed
//! `w`, inertia `J` and viscous drag `B`. While the shaft turns in one direction the solution is an exponential. If the
//! shaft stops within the window, the time of the stop is a logarithm. Until the end of the window the shaft then stays
//! at rest, or turns in the other direction.

use super::friction::Friction;
use super::load::Shaft;
use super::numeric::{ln_1p_over_x, phi1, phi2};

/// Coefficients of the solution. The coefficients depend on the length of the window, not on speed or torque.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mechanics {
    /// Length of the window, s.
    pub window: f64,
    /// Speed at the end of the window per speed at its beginning.
    decay: f64,
    /// Mean speed during the window per speed at its beginning.
    mean: f64,
    /// Speed at the end of the window per torque, rad/s per N m.
    gain: f64,
    /// Mean speed during the window per torque, rad/s per N m.
    pub mean_gain: f64,
}

/// Motion of the shaft during a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ShaftMotion {
    /// Mean speed, rad/s.
    pub mean: f64,
    /// Speed at the end of the window, rad/s.
    pub end: f64,
    /// Angle turned against dry friction, the sum of both directions, rad, at least 0. It is 0 for a motion without dry
    /// friction.
    pub sliding_angle: f64,
}

impl ShaftMotion {
    /// The shaft rests during the whole window.
    pub(super) const REST: Self = Self { mean: 0.0, end: 0.0, sliding_angle: 0.0 };
}

impl Mechanics {
    /// Computes the coefficients for a window of `window` seconds.
    pub(super) fn new(shaft: &Shaft, window: f64) -> Self {
        let x = shaft.drag.0 * window / shaft.inertia.0;
        Self {
            window,
            decay: (-x).exp(),
            mean: phi1(x),
            gain: window / shaft.inertia.0 * phi1(x),
            mean_gain: window / shaft.inertia.0 * phi2(x),
        }
    }

    /// Returns the motion from the initial `speed` (rad/s) under `torque` (N m), without dry friction.
    pub(super) fn without_friction(&self, speed: f64, torque: f64) -> ShaftMotion {
        ShaftMotion {
            mean: self.mean * speed + self.mean_gain * torque,
            end: self.decay * speed + self.gain * torque,
            sliding_angle: 0.0,
        }
    }

    /// Returns the motion from the initial `speed` (rad/s) under `torque` (N m), with dry friction.
    ///
    /// If `sticks` is true, a shaft that stops remains at rest until the end of the window. If `sticks` is false and
    /// `torque` exceeds the Coulomb torque, the shaft starts in the direction of `torque`.
    pub(super) fn with_friction(
        &self,
        shaft: &Shaft,
        friction: &Friction,
        speed: f64,
        torque: f64,
        sticks: bool,
    ) -> ShaftMotion {
        let coulomb = friction.coulomb.0;
        let starts = !sticks && torque.abs() > coulomb;
        let sign = if speed != 0.0 {
            speed.signum()
        } else if starts {
            torque.signum()
        } else {
            return ShaftMotion::REST;
        };
        let sliding = self.without_friction(speed, torque - sign * coulomb);
        if sliding.end * sign >= 0.0 {
            return ShaftMotion { sliding_angle: sliding.mean.abs() * self.window, ..sliding };
        }
        // The shaft stops within the window at the time `stop`, so the braking torque is above 0.
        let braking_torque = coulomb - sign * torque;
        let stop_without_drag = shaft.inertia.0 * speed.abs() / braking_torque;
        let stop = stop_without_drag * ln_1p_over_x(shaft.drag.0 * speed.abs() / braking_torque);
        let stop = stop.min(self.window);
        let forward = travel(shaft, speed, -sign * braking_torque, stop);
        if !starts {
            return ShaftMotion { mean: forward / self.window, end: 0.0, sliding_angle: forward.abs() };
        }
        let rest = self.window - stop;
        let back_torque = torque + sign * coulomb;
        let back = travel(shaft, 0.0, back_torque, rest);
        let end = rest / shaft.inertia.0 * phi1(shaft.drag.0 * rest / shaft.inertia.0) * back_torque;
        ShaftMotion { mean: (forward + back) / self.window, end, sliding_angle: forward.abs() + back.abs() }
    }
}

/// Returns the angle in rad that the shaft turns within `time` (s) from `speed` (rad/s) under `torque` (N m).
fn travel(shaft: &Shaft, speed: f64, torque: f64, time: f64) -> f64 {
    let x = shaft.drag.0 * time / shaft.inertia.0;
    time * (phi1(x) * speed + time / shaft.inertia.0 * phi2(x) * torque)
}

#[cfg(test)]
mod tests {
    use super::super::si::{Drag, KgM2, NewtonMetres};
    use super::*;

    const FRICTION: Friction = Friction { coulomb: NewtonMetres(3e-3), breakaway: NewtonMetres(4e-3) };

    fn shaft(drag: f64) -> Shaft {
        Shaft { inertia: KgM2(1e-5), drag: Drag(drag), torque_ratio: 1.0 }
    }

    /// Asserts that a window has the same result as 37 short windows in its place.
    fn assert_sum_of_windows(shaft: &Shaft, speed: f64, torque: f64) {
        let sticks = FRICTION.sticks(torque);
        let whole = Mechanics::new(shaft, 1e-2).with_friction(shaft, &FRICTION, speed, torque, sticks);
        let piece = Mechanics::new(shaft, 1e-2 / 37.0);
        let (mut end, mut angle, mut sliding_angle) = (speed, 0.0, 0.0);
        for _ in 0..37 {
            let turned = piece.with_friction(shaft, &FRICTION, end, torque, sticks);
            end = turned.end;
            angle += turned.mean * piece.window;
            sliding_angle += turned.sliding_angle;
        }
        let what = format!("{shaft:?} {speed} {torque}: {whole:?}");
        let scale = speed.abs() + 1e3 * torque.abs() + 1e-12;
        assert!((end - whole.end).abs() < 1e-11 * scale, "{what} {end}");
        assert!((angle - whole.mean * 1e-2).abs() < 1e-13 * scale, "{what} {angle}");
        assert!((sliding_angle - whole.sliding_angle).abs() < 1e-13 * scale, "{what} {sliding_angle}");
    }

    #[test]
    fn one_window_equals_many_short_windows() {
        for drag in [0.0, 1e-7, 1e-5, 1e-2] {
            for speed in [-200.0, -1.0, -1e-6, 0.0, 1e-9, 0.02, 3.0, 150.0] {
                for torque in [-0.05, -4e-3, -3e-3, -1e-3, 0.0, 2e-3, 3.5e-3, 0.01] {
                    assert_sum_of_windows(&shaft(drag), speed, torque);
                }
            }
        }
    }

    #[test]
    fn a_shaft_stops_at_exactly_zero_and_stays_or_turns_back() {
        let shaft = shaft(1e-5);
        let mechanics = Mechanics::new(&shaft, 1e-2);
        let motion = |speed, torque| {
            mechanics.with_friction(&shaft, &FRICTION, speed, torque, FRICTION.sticks(torque))
        };
        assert_eq!(motion(0.0, 4e-3), ShaftMotion::REST);
        assert_eq!(motion(1.0, -4e-3).end, 0.0);
        assert_eq!(motion(-1.0, 0.0).end, 0.0);
        assert!(motion(1.0, -4e-3).mean > 0.0);
        assert!(motion(1.0, -5e-3).end < 0.0);
        assert!(motion(0.0, 5e-3).end > 0.0);
        // Breakaway torque acts on a shaft at rest only: a moving shaft continues under the same torque.
        assert!(motion(1e-9, 4e-3).end > 0.1);
    }
}
