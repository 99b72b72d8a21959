//! Parts of the simulated board, and the constants of its motors as the firmware is configured for them.
//!
//! ```
//! use motor_hub::model::catalogue::characterised;
//! use simulated::hardware::winding;
//!
//! let motor = characterised("AM 60 A")?;
//! let configured = winding(&motor)?;
//! assert!((f64::from(configured.resistance.as_milliohms()) - 1e3 * motor.r.0).abs() < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use motor_hub::braking::Winding;
use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::motor::ThermalLimit;
use motor_hub::regulator::Mechanics;
use motor_hub::units::{EmfConstant, Inductance, RangeError, Resistance};

/// Number of motors that the hub drives.
pub const MOTORS: usize = 4;

/// An ideal bridge: it switches without delay and accepts any duty. Scenarios have ideal bridges by default.
pub const BRIDGE: BridgeConstants = BridgeConstants::IDEAL;

/// Constants of the real bridge, a VNH5019, with its switching times.
pub const REAL_BRIDGE: BridgeConstants = BridgeConstants::VNH5019;

/// Diameter of the wheels of the drive base that the inertial sensor stands on, in mm. Motor 0 drives the left wheel,
/// motor 1 the right one, and both drive forward when they turn CW.
pub const WHEEL_DIAMETER_MM: f64 = 90.0;

/// Distance between the centres of the wheels, in mm.
pub const TRACK_MM: f64 = 300.0;

/// Returns the winding constants that the firmware is configured with.
///
/// # Errors
/// If a constant of the motor does not fit the firmware's range.
pub fn winding(motor: &Motor) -> Result<Winding, RangeError> {
    Ok(Winding {
        emf: EmfConstant::from_ke(motor.ke.0, motor.counts_per_rev_motor)?,
        resistance: Resistance::from_ohms(motor.r.0)?,
        inductance: Some(Inductance::from_millihenries(1e3 * motor.l.0)?),
    })
}

/// Returns a thermal limit for a motor whose data sheet gives none: the continuous current is a third of the stall
/// current at 12 V. An AM 60 A then heats its winding by 4.8 W; a stall heats it by 44 W. The time constants have their
/// usual values. This is a cautious guess, not a measurement.
///
/// # Errors
/// If the continuous current does not fit the firmware's range.
pub fn thermal_limit(motor: &Motor) -> Result<ThermalLimit, RangeError> {
    let stall_ma = 1e3 * 12.0 / motor.r.0;
    ThermalLimit::new((stall_ma / 3.0) as u16, ThermalLimit::USUAL_WINDING_S, ThermalLimit::USUAL_CASE_S)
}

/// Returns the mechanics of a motor with its load, at the motor's shaft.
pub fn mechanics(motor: &Motor, load: &Load) -> Mechanics {
    let shaft = Shaft::new(motor, load);
    Mechanics {
        torque_constant: motor.kt.0,
        counts_per_turn: motor.counts_per_rev_motor,
        inertia: shaft.inertia.0,
        drag: shaft.drag.0,
        friction: motor.friction.coulomb.0,
    }
}
