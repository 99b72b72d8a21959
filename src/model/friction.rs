//! What a motor shaft feels beside viscous drag: dry friction, and the cogging of its rotor.
//!
//! Dry friction is Coulomb's: sliding takes the same torque at any speed, against the motion. At rest
//! it is whatever keeps the shaft at rest, up to the breakaway torque. Cogging is the pull of the
//! magnets on the rotor's teeth: periodic in the angle, and conservative, so that a whole turn takes
//! no work.
//!
//! The catalogue was measured with viscous drag alone and has figures for neither, so its motors have
//! none of them. Both are torques on the motor shaft.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::{Motor, characterised};
//! use motor_hub::model::friction::Friction;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::plant::{Influence, Plant};
//! use motor_hub::model::si::{Hertz, NewtonMetres, RadPerSec, Seconds, Volts};
//! use motor_hub::model::switching::Bridge;
//!
//! // 5 % of the stall torque to slide, so 6.5 % to break away: 6 % of the voltage moves nothing.
//! let motor = characterised("AM 60 A")?.with_measured_rotor_inertia();
//! let coulomb = NewtonMetres(0.05 * motor.stall_torque(Volts(12.0)).0);
//! let motor = Motor { friction: Friction::with_coulomb(coulomb), ..motor };
//! let mut plant = Plant::new(motor, Load::NONE, Bridge::IDEAL, Hertz(20_000.0));
//! plant.run(Seconds(1.0), Influence::pwm(Mode::Cw98, 1.0), Volts(0.06 * 12.0));
//! assert_eq!((plant.speed(), plant.angle()), (RadPerSec(0.0), 0.0));
//! plant.run(Seconds(1.0), Influence::pwm(Mode::Cw98, 1.0), Volts(0.07 * 12.0));
//! assert!(plant.speed().0 > 1.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::si::{Joules, NewtonMetres};

/// Dry friction of a motor and its gears, on the motor shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Friction {
    /// Torque against the motion while the shaft turns, at least 0.
    pub coulomb: NewtonMetres,
    /// Torque up to which a shaft at rest stays at rest; what is below `coulomb` counts as `coulomb`.
    pub breakaway: NewtonMetres,
}

impl Friction {
    /// None.
    pub const NONE: Self = Self { coulomb: NewtonMetres(0.0), breakaway: NewtonMetres(0.0) };

    /// Breakaway torque as a multiple of Coulomb torque, where only that is known.
    pub const STATIC_RATIO: f64 = 1.3;

    /// Coulomb friction of at least 0, and [`STATIC_RATIO`](Self::STATIC_RATIO) times that to break away.
    #[must_use]
    pub const fn with_coulomb(coulomb: NewtonMetres) -> Self {
        Self { coulomb, breakaway: NewtonMetres(Self::STATIC_RATIO * coulomb.0) }
    }

    /// Whether a shaft at rest stays there under `torque`.
    pub(super) fn holds(&self, torque: f64) -> bool {
        torque.abs() <= self.breakaway.0.max(self.coulomb.0)
    }
}

/// Cogging of a rotor: `-amplitude sin(per_turn angle)`, so that angle 0 is where it likes to rest.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cogging {
    /// Largest torque, on the motor shaft, at least 0.
    pub amplitude: NewtonMetres,
    /// Places of rest per turn of the motor: the least common multiple of the numbers of teeth and of
    /// poles, as 6 with three teeth between two poles, and 10 with five.
    pub per_turn: u16,
}

impl Cogging {
    /// None.
    pub const NONE: Self = Self { amplitude: NewtonMetres(0.0), per_turn: 0 };

    /// Torque at a motor angle in rad.
    #[must_use]
    pub fn torque(&self, angle: f64) -> NewtonMetres {
        NewtonMetres(self.mean_torque(angle, 0.0))
    }

    /// Energy stored at a motor angle in rad, 0 at a place of rest.
    #[must_use]
    pub fn energy(&self, angle: f64) -> Joules {
        if self.per_turn == 0 {
            return Joules(0.0);
        }
        let half = (0.5 * f64::from(self.per_turn) * angle).sin();
        Joules(2.0 * self.amplitude.0 / f64::from(self.per_turn) * half * half)
    }

    /// Mean of the torque over the angles from `from` to `from + by`: times `by`, it is the stored
    /// energy that is set free between them.
    pub(super) fn mean_torque(&self, from: f64, by: f64) -> f64 {
        if self.amplitude.0 == 0.0 {
            return 0.0;
        }
        let half = 0.5 * f64::from(self.per_turn) * by;
        // sin(x)/x, its series where the next term is below 1e-16.
        let spread = if half.abs() < 0.25 {
            let x = half * half;
            1.0 - x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0 * (1.0 - x / 110.0))))
        } else {
            half.sin() / half
        };
        -self.amplitude.0 * (f64::from(self.per_turn) * from + half).sin() * spread
    }

    /// Slope of the torque where the shaft likes to rest, N m/rad.
    pub(super) fn stiffness(&self) -> f64 {
        self.amplitude.0 * f64::from(self.per_turn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COGGING: Cogging = Cogging { amplitude: NewtonMetres(2e-3), per_turn: 10 };

    #[test]
    fn mean_torque_sets_free_what_was_stored() {
        for from in [-700.0, -0.3, 0.0, 0.1, 55.5] {
            for by in [-1.7, -0.0501, -0.0499, -1e-7, 0.0, 1e-9, 1e-3, 0.4, 7.0] {
                let freed = COGGING.energy(from).0 - COGGING.energy(from + by).0;
                let work = COGGING.mean_torque(from, by) * by;
                assert!((work - freed).abs() < 1e-15, "{from} {by}: {work} {freed}");
            }
        }
    }

    #[test]
    fn a_whole_turn_takes_no_work() {
        let per_step = core::f64::consts::TAU / 1000.0;
        let work: f64 = (0..1000).map(|n| COGGING.torque(f64::from(n) * per_step).0 * per_step).sum();
        assert!(work.abs() < 1e-16, "{work}");
        assert!(COGGING.mean_torque(0.1, core::f64::consts::TAU).abs() < 1e-17);
    }

    #[test]
    fn cogging_repeats_from_tooth_to_tooth_and_rests_at_angle_0() {
        let tooth = core::f64::consts::TAU / 10.0;
        for angle in [0.0, 0.05, 0.2, -0.31] {
            assert!((COGGING.torque(angle).0 - COGGING.torque(angle + tooth).0).abs() < 1e-17);
        }
        assert_eq!(COGGING.torque(0.0), NewtonMetres(0.0));
        assert!(COGGING.torque(0.01).0 < 0.0 && COGGING.torque(-0.01).0 > 0.0);
        assert!((COGGING.torque(tooth / 4.0).0 + 2e-3).abs() < 1e-18);
    }

    #[test]
    fn breakaway_below_coulomb_counts_as_coulomb() {
        let friction = Friction { coulomb: NewtonMetres(1.0), breakaway: NewtonMetres(0.0) };
        assert!(friction.holds(1.0) && friction.holds(-1.0) && !friction.holds(1.001));
        let friction = Friction::with_coulomb(NewtonMetres(1.0));
        assert!(friction.holds(-1.3) && !friction.holds(1.301));
    }
}
