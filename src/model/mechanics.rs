//! The mechanical side of a plant: how a shaft turns through one window of constant torque, exactly.
//!
//! `J w' + B w = torque - friction` has an exponential as its solution while the shaft slides in one
//! direction. Where it comes to a stop within the window the instant is a logarithm; there it stays,
//! or turns the other way for the rest of the window.

use super::friction::Friction;
use super::load::Shaft;
use super::numeric::{ln_1p_share, phi1, phi2};
use super::switching::Circuit;

/// The solution over one window from its length, without what changes from window to window.
#[derive(Clone, Copy, Debug)]
pub(super) struct Mechanics {
    pub window: f64,
    /// Share of the speed that is left after the window.
    decay: f64,
    /// Share of the speed that its mean over the window keeps.
    mean: f64,
    /// Final speed per torque.
    gain: f64,
    /// Mean speed per torque.
    pub mean_gain: f64,
    /// How much less current a volt of back EMF lets through in the window's mean, 1/ohm, at most.
    pub admittance: f64,
}

/// How the shaft moved in a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Turned {
    /// Mean speed.
    pub mean: f64,
    /// Speed at the window's end.
    pub end: f64,
    /// Angle over which there was friction, forth and back, at least 0.
    pub rubbed: f64,
}

impl Turned {
    /// Not at all.
    pub(super) const REST: Self = Self { mean: 0.0, end: 0.0, rubbed: 0.0 };
}

impl Mechanics {
    pub(super) fn new(shaft: &Shaft, circuit: &Circuit, window: f64) -> Self {
        let x = shaft.drag.0 * window / shaft.inertia.0;
        Self {
            window,
            decay: (-x).exp(),
            mean: phi1(x),
            gain: window / shaft.inertia.0 * phi1(x),
            mean_gain: window / shaft.inertia.0 * phi2(x),
            admittance: (1.0 - phi1(window * circuit.r.0 / circuit.l.0)) / circuit.r.0,
        }
    }

    /// From `speed` under `torque`, without friction.
    pub(super) fn free(&self, speed: f64, torque: f64) -> Turned {
        Turned {
            mean: self.mean * speed + self.mean_gain * torque,
            end: self.decay * speed + self.gain * torque,
            rubbed: 0.0,
        }
    }

    /// The same with friction. `holds` tells whether the shaft stays where it comes to rest.
    pub(super) fn rubbing(
        &self,
        shaft: &Shaft,
        friction: &Friction,
        speed: f64,
        torque: f64,
        holds: bool,
    ) -> Turned {
        let coulomb = friction.coulomb.0;
        let starts = !holds && torque.abs() > coulomb;
        let sign = if speed != 0.0 {
            speed.signum()
        } else if starts {
            torque.signum()
        } else {
            return Turned::REST;
        };
        let along = self.free(speed, torque - sign * coulomb);
        if along.end * sign >= 0.0 {
            return Turned { rubbed: along.mean.abs() * self.window, ..along };
        }
        // Stops within the window; what brings it to rest is above 0, or it would not.
        let braking = coulomb - sign * torque;
        let undragged = shaft.inertia.0 * speed.abs() / braking;
        let stop = undragged * ln_1p_share(shaft.drag.0 * speed.abs() / braking);
        let stop = stop.min(self.window);
        let forth = travel(shaft, speed, -sign * braking, stop);
        if !starts {
            return Turned { mean: forth / self.window, end: 0.0, rubbed: forth.abs() };
        }
        let rest = self.window - stop;
        let back_torque = torque + sign * coulomb;
        let back = travel(shaft, 0.0, back_torque, rest);
        let end = rest / shaft.inertia.0 * phi1(shaft.drag.0 * rest / shaft.inertia.0) * back_torque;
        Turned { mean: (forth + back) / self.window, end, rubbed: forth.abs() + back.abs() }
    }
}

/// Angle turned within `time`.
fn travel(shaft: &Shaft, speed: f64, torque: f64, time: f64) -> f64 {
    let x = shaft.drag.0 * time / shaft.inertia.0;
    time * (phi1(x) * speed + time / shaft.inertia.0 * phi2(x) * torque)
}

#[cfg(test)]
mod tests {
    use super::super::si::{Drag, Henries, KgM2, NewtonMetres, Ohms};
    use super::super::switching::Bridge;
    use super::*;

    const FRICTION: Friction = Friction { coulomb: NewtonMetres(3e-3), breakaway: NewtonMetres(4e-3) };
    const CIRCUIT: Circuit = Circuit { r: Ohms(3.3), l: Henries(7e-4), bridge: Bridge::IDEAL };

    fn shaft(drag: f64) -> Shaft {
        Shaft { inertia: KgM2(1e-5), drag: Drag(drag), torque_ratio: 1.0 }
    }

    fn cases(mut check: impl FnMut(&Shaft, f64, f64, bool)) {
        for drag in [0.0, 1e-7, 1e-5, 1e-2] {
            for speed in [-200.0, -1.0, -1e-6, 0.0, 1e-9, 0.02, 3.0, 150.0] {
                for torque in [-0.05, -4e-3, -3e-3, -1e-3, 0.0, 2e-3, 3.5e-3, 0.01] {
                    for holds in [false, true] {
                        check(&shaft(drag), speed, torque, holds);
                    }
                }
            }
        }
    }

    #[test]
    fn without_friction_it_is_free_to_the_last_bit() {
        cases(|shaft, speed, torque, _| {
            let mechanics = Mechanics::new(shaft, &CIRCUIT, 1e-2);
            let free = mechanics.free(speed, torque);
            // What passes zero is pieced together there; and rest without torque has no sign.
            if free.end * speed > 0.0 {
                let turned = mechanics.rubbing(shaft, &Friction::NONE, speed, torque, false);
                assert_eq!(
                    (turned.mean.to_bits(), turned.end.to_bits()),
                    (free.mean.to_bits(), free.end.to_bits())
                );
            }
        });
    }

    #[test]
    fn passing_zero_without_friction_is_seamless() {
        cases(|shaft, speed, torque, _| {
            let mechanics = Mechanics::new(shaft, &CIRCUIT, 1e-2);
            let free = mechanics.free(speed, torque);
            let turned = mechanics.rubbing(shaft, &Friction::NONE, speed, torque, false);
            let scale = speed.abs() + 1e3 * torque.abs();
            assert!((turned.mean - free.mean).abs() <= 1e-12 * scale, "{shaft:?} {speed} {torque}");
            assert!((turned.end - free.end).abs() <= 1e-12 * scale, "{shaft:?} {speed} {torque}");
        });
    }

    #[test]
    fn work_is_motion_and_heat() {
        let mut worst: f64 = 0.0;
        cases(|shaft, speed, torque, holds| {
            if shaft.drag.0 > 0.0 {
                return;
            }
            let mechanics = Mechanics::new(shaft, &CIRCUIT, 1e-2);
            let turned = mechanics.rubbing(shaft, &FRICTION, speed, torque, holds);
            let work = torque * turned.mean * 1e-2;
            let heat = FRICTION.coulomb.0 * turned.rubbed;
            let before = 0.5 * shaft.inertia.0 * speed * speed;
            let after = 0.5 * shaft.inertia.0 * turned.end * turned.end;
            let miss = (work - heat - after + before).abs() / (work.abs() + heat + before + after + 1e-300);
            worst = worst.max(miss);
            assert!(miss < 1e-12, "{speed} {torque} {holds}: {miss}");
        });
        assert!(worst > 0.0);
    }

    #[test]
    fn one_window_is_many_short_ones() {
        cases(|shaft, speed, torque, _| {
            let holds = FRICTION.holds(torque);
            let whole = Mechanics::new(shaft, &CIRCUIT, 1e-2).rubbing(shaft, &FRICTION, speed, torque, holds);
            let piece = Mechanics::new(shaft, &CIRCUIT, 1e-2 / 37.0);
            let (mut end, mut angle, mut rubbed) = (speed, 0.0, 0.0);
            for _ in 0..37 {
                let turned = piece.rubbing(shaft, &FRICTION, end, torque, holds);
                end = turned.end;
                angle += turned.mean * piece.window;
                rubbed += turned.rubbed;
            }
            let what = format!("{shaft:?} {speed} {torque}: {whole:?}");
            let scale = speed.abs() + 1e3 * torque.abs() + 1e-12;
            assert!((end - whole.end).abs() < 1e-11 * scale, "{what} {end}");
            assert!((angle - whole.mean * 1e-2).abs() < 1e-13 * scale, "{what} {angle}");
            assert!((rubbed - whole.rubbed).abs() < 1e-13 * scale, "{what} {rubbed}");
        });
    }

    #[test]
    fn it_stops_exactly_and_stays_or_turns_back() {
        let shaft = shaft(1e-5);
        let mechanics = Mechanics::new(&shaft, &CIRCUIT, 1e-2);
        let rubbing =
            |speed, torque| mechanics.rubbing(&shaft, &FRICTION, speed, torque, FRICTION.holds(torque));
        assert_eq!(rubbing(0.0, 4e-3), Turned::REST);
        assert_eq!(rubbing(1.0, -4e-3).end, 0.0);
        assert_eq!(rubbing(-1.0, 0.0).end, 0.0);
        assert!(rubbing(1.0, -4e-3).mean > 0.0);
        assert!(rubbing(1.0, -5e-3).end < 0.0);
        assert!(rubbing(0.0, 5e-3).end > 0.0);
        // Breakaway is for what rests: under the same torque a moving shaft goes on.
        assert!(rubbing(1e-9, 4e-3).end > 0.1);
    }
}
