//! What the simulated board is made of, and what the firmware is told of it and of its motors.

use motor_hub::braking::Electrical;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::si::{Hertz, Ohms, Volts};
use motor_hub::model::switching::Bridge;
use motor_hub::units::{EmfConstant, RangeError};

/// How many motors the hub drives.
pub const MOTORS: usize = 4;

/// PWM of the bridges, as on the real board.
pub const PWM: Hertz = Hertz(20_000.0);
/// A bridge of the VNH5019 kind: drop of a catch diode, resistance of a closed switch.
pub const BRIDGE: Bridge = Bridge { vd: Volts(0.7), ron: Ohms(0.05) };

/// What the firmware is told of a motor's winding and of this board's bridges.
pub fn electrical(motor: &Motor) -> Electrical {
    // Casts from float saturate.
    Electrical {
        resistance_mohm: (1e3 * motor.r.0).round() as u16,
        inductance_uh: Some((1e6 * motor.l.0).round() as u16),
        diode_mv: (1e3 * BRIDGE.vd.0) as u16,
        switch_mohm: (1e3 * BRIDGE.ron.0) as u16,
        pwm_hz: PWM.0 as u32,
    }
}

/// The firmware's back-EMF constant of a motor.
///
/// # Errors
/// [`RangeError::EmfConstant`] if it does not fit in 6q20.
pub fn emf_constant(motor: &Motor) -> Result<EmfConstant, RangeError> {
    EmfConstant::from_bits((motor.ke_fw() * f64::from(1 << 20)).round() as i32)
}
