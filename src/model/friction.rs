//! Torques on a motor shaft besides viscous drag: dry friction, and the cogging of the rotor.
//!
//! Dry friction is Coulomb friction with breakaway. While the shaft turns, the friction torque is constant and against
//! the motion. While the shaft is at rest, the friction torque balances the other torques up to the *breakaway torque*.
//! *Cogging* is the attraction between magnets and rotor teeth. The torque of cogging is periodic in the angle, and
//! does no work over a whole turn.
//!
//! Motors of the catalogue have neither dry friction nor cogging, because they were measured with viscous drag alone.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::{Motor, characterised};
//! use motor_hub::model::friction::Friction;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::plant::{PlantInput, Plant};
//! use motor_hub::model::si::{Hertz, NewtonMetres, RadPerSec, Seconds, Volts};
//! use motor_hub::model::switching::Bridge;
//!
//! // With 5 % of the stall torque as Coulomb torque the breakaway torque is 6.5 %. So 6 % voltage moves nothing.
//! let motor = characterised("AM 60 A")?.with_measured_rotor_inertia();
//! let coulomb = NewtonMetres(0.05 * motor.stall_torque(Volts(12.0)).0);
//! let motor = Motor { friction: Friction::with_coulomb(coulomb), ..motor };
//! let mut plant = Plant::new(motor, Load::NONE, Bridge::IDEAL, Hertz(20_000.0));
//! plant.run(Seconds(1.0), PlantInput::pwm(Mode::Cw98, 1.0), Volts(0.06 * 12.0));
//! assert_eq!((plant.speed(), plant.angle()), (RadPerSec(0.0), 0.0));
//! plant.run(Seconds(1.0), PlantInput::pwm(Mode::Cw98, 1.0), Volts(0.07 * 12.0));
//! assert!(plant.speed().0 > 1.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::si::{Joules, NewtonMetres};

/// Dry friction of a motor and its gears, on the motor shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Friction {
    /// Torque against the motion while the shaft turns, at least 0.
    pub coulomb: NewtonMetres,
    /// Torque up to which a shaft at rest stays at rest. A value below `coulomb` acts as `coulomb`.
    pub breakaway: NewtonMetres,
}

impl Friction {
    /// No dry friction.
    pub const NONE: Self = Self { coulomb: NewtonMetres(0.0), breakaway: NewtonMetres(0.0) };

    /// Ratio of breakaway torque to Coulomb torque if only the Coulomb torque is known, without unit. The value is an
    /// assumption. The encoder check allows a ratio of up to 4/3.
    pub const STATIC_RATIO: f64 = 1.3;

    /// Creates a friction from its Coulomb torque, at least 0. The breakaway torque is
    /// [`STATIC_RATIO`](Self::STATIC_RATIO) times the Coulomb torque.
    #[must_use]
    pub const fn with_coulomb(coulomb: NewtonMetres) -> Self {
        Self { coulomb, breakaway: NewtonMetres(Self::STATIC_RATIO * coulomb.0) }
    }

    /// Returns true if a shaft at rest stays at rest under `torque`, in N m.
    pub(super) fn sticks(&self, torque: f64) -> bool {
        torque.abs() <= self.breakaway.0.max(self.coulomb.0)
    }
}

/// Cogging of a rotor. Its torque is `-amplitude * sin(per_turn * angle)`, so the rotor has a stable position at the
/// angle 0 rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cogging {
    /// Largest cogging torque on the motor shaft, at least 0.
    pub amplitude: NewtonMetres,
    /// Number of stable positions per turn of the motor shaft. It is the least common multiple of the numbers of rotor
    /// teeth and magnet poles: with two poles it is 6 for three teeth, and 10 for five teeth.
    pub per_turn: u16,
}

impl Cogging {
    /// No cogging.
    pub const NONE: Self = Self { amplitude: NewtonMetres(0.0), per_turn: 0 };

    /// Returns the torque at a motor angle in rad.
    #[must_use]
    pub fn torque(&self, angle: f64) -> NewtonMetres {
        NewtonMetres(self.mean_torque(angle, 0.0))
    }

    /// Returns the energy stored at a motor angle in rad. The energy is 0 at a stable position.
    #[must_use]
    pub fn energy(&self, angle: f64) -> Joules {
        if self.per_turn == 0 {
            return Joules(0.0);
        }
        let half = (0.5 * f64::from(self.per_turn) * angle).sin();
        Joules(2.0 * self.amplitude.0 / f64::from(self.per_turn) * half * half)
    }

    /// Returns the mean torque in N m over the angles from `from` to `from + by`, in rad.
    ///
    /// The mean torque times `by` is the decrease of the stored energy between the two angles.
    pub(super) fn mean_torque(&self, from: f64, by: f64) -> f64 {
        if self.amplitude.0 == 0.0 {
            return 0.0;
        }
        let half = 0.5 * f64::from(self.per_turn) * by;
        // This is sin(x)/x. For small x the series is exact enough: its next term is below 1e-16.
        let spread = if half.abs() < 0.25 {
            let x = half * half;
            1.0 - x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0 * (1.0 - x / 110.0))))
        } else {
            half.sin() / half
        };
        -self.amplitude.0 * (f64::from(self.per_turn) * from + half).sin() * spread
    }

    /// Returns the slope of the torque at a stable position, N m/rad.
    pub(super) fn stiffness(&self) -> f64 {
        self.amplitude.0 * f64::from(self.per_turn)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const COGGING: Cogging = Cogging { amplitude: NewtonMetres(2e-3), per_turn: 10 };

    #[test]
    fn mean_torque_times_angle_is_the_released_energy() {
        for from in [-700.0, -0.3, 0.0, 0.1, 55.5] {
            for by in [-1.7, -0.0501, -0.0499, -1e-7, 0.0, 1e-9, 1e-3, 0.4, 7.0] {
                let freed = COGGING.energy(from).0 - COGGING.energy(from + by).0;
                let work = COGGING.mean_torque(from, by) * by;
                assert!((work - freed).abs() < 1e-15, "{from} {by}: {work} {freed}");
            }
        }
    }

    #[test]
    fn breakaway_torque_is_at_least_the_coulomb_torque() {
        let friction = Friction { coulomb: NewtonMetres(1.0), breakaway: NewtonMetres(0.0) };
        assert!(friction.sticks(1.0) && friction.sticks(-1.0) && !friction.sticks(1.001));
        let friction = Friction::with_coulomb(NewtonMetres(1.0));
        assert!(friction.sticks(-1.3) && !friction.sticks(1.301));
    }
}
