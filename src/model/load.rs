//! Loads on the output shaft, and their effect on the motor shaft through the gearbox.
//!
//! ```
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::{Load, Shaft};
//! use motor_hub::model::si::{Kilograms, Metres};
//!
//! // A gearbox of 60:1 divides the inertia of a flywheel by more than 2000.
//! let motor = characterised("AM 60 A")?.with_measured_rotor_inertia();
//! let load = Load::flywheel(Kilograms(0.5), Metres(0.06));
//! let shaft = Shaft::new(&motor, &load);
//! assert!(shaft.inertia.0 - motor.j.0 < load.inertia_after.0 / 2_000.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

use super::catalogue::Motor;
use super::si::{Drag, KgM2, Kilograms, Metres, NewtonMetres};

/// A load on the output shaft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Load {
    /// Moment of inertia on the output shaft.
    pub inertia_after: KgM2,
    /// Viscous drag on the output shaft.
    pub drag_after: Drag,
    /// Constant external torque on the output shaft, positive when it drives clockwise.
    pub torque_after: NewtonMetres,
}

impl Load {
    /// No load: the motor and its gearbox only.
    pub const NONE: Self =
        Self { inertia_after: KgM2(0.0), drag_after: Drag(0.0), torque_after: NewtonMetres(0.0) };

    /// Creates a flywheel: a solid disc with the inertia `m r² / 2` and no drag.
    #[must_use]
    pub fn flywheel(mass: Kilograms, radius: Metres) -> Self {
        Self { inertia_after: KgM2(0.5 * mass.0 * radius.0 * radius.0), ..Self::NONE }
    }

    /// Creates a load with an inertia, without drag and torque.
    #[must_use]
    pub const fn inertia(inertia_after: KgM2) -> Self {
        Self { inertia_after, ..Self::NONE }
    }
}

/// Motor and load, combined as one body on the motor shaft.
///
/// `eta` is the efficiency of the gearbox and `N` its reduction ratio (R. Atkinson, *On Proportional Braking in H
/// Bridges*, 2018, section 2.2.2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaft {
    /// Inertia of motor and load together, `J + Jafter / (eta N²)`.
    pub inertia: KgM2,
    /// Viscous drag of motor and load together, `B + Bafter / (eta N²)`.
    pub drag: Drag,
    /// Torque on the motor shaft per torque on the output shaft, `1 / (eta N)`.
    pub torque_ratio: f64,
}

impl Shaft {
    /// Converts `load` to the motor shaft through the gearbox of `motor` and adds the motor's own inertia and drag.
    #[must_use]
    pub fn new(motor: &Motor, load: &Load) -> Self {
        let n = motor.gear_ratio;
        let reflection = 1.0 / (motor.eta * n * n);
        Self {
            inertia: KgM2(motor.j.0 + load.inertia_after.0 * reflection),
            drag: Drag(motor.b.0 + load.drag_after.0 * reflection),
            torque_ratio: 1.0 / (motor.eta * n),
        }
    }
}
