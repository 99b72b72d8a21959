//! What the simulated board is made of, and what the firmware is told of it and of its motors.
//!
//! ```
//! use motor_hub::model::catalogue::characterised;
//! use simulated::hardware::winding;
//!
//! let motor = characterised("AM 60 A")?;
//! let told = winding(&motor)?;
//! assert!((f64::from(told.resistance.as_milliohms()) - 1e3 * motor.r.0).abs() < 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use motor_hub::braking::Winding;
use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::{Load, Shaft};
use motor_hub::motor::ThermalLimit;
use motor_hub::regulator::Mechanics;
use motor_hub::units::{EmfConstant, Inductance, RangeError, Resistance};

/// How many motors the hub drives.
pub const MOTORS: usize = 4;

/// This board's bridges, unless a scenario wants real ones: those switch at once, and obey any duty.
pub const BRIDGE: BridgeConstants = BridgeConstants::IDEAL;

/// The same as it really is, with its timing.
pub const REAL_BRIDGE: BridgeConstants = BridgeConstants::VNH5019;

/// What the firmware is told of a motor.
///
/// # Errors
/// If one of its constants does not fit the firmware's range.
pub fn winding(motor: &Motor) -> Result<Winding, RangeError> {
    Ok(Winding {
        emf: EmfConstant::from_ke(motor.ke.0, motor.counts_per_rev_motor)?,
        resistance: Resistance::from_ohms(motor.r.0)?,
        inductance: Some(Inductance::from_millihenries(1e3 * motor.l.0)?),
    })
}

/// What a motor's winding stands, for want of a data sheet that says so: a third of its stall current at 12 V for
/// ever, 4.4 W of an AM 60 A's 40 W, with the usual time constants. A guess on the safe side; nobody has measured it.
///
/// # Errors
/// If that current does not fit the firmware's range.
pub fn thermal_limit(motor: &Motor) -> Result<ThermalLimit, RangeError> {
    let stall_ma = 1e3 * 12.0 / motor.r.0;
    ThermalLimit::new((stall_ma / 3.0) as u16, ThermalLimit::USUAL_WINDING_S, ThermalLimit::USUAL_CASE_S)
}

/// How a motor moves with its load, seen from the motor's shaft.
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
