//! The settings that are proposed for an identified motor, and the catalogue motor with which the identified motor is
//! compared.

use motor_hub::extension::settings::MotorSettings;
use motor_hub::model::catalogue::{Motor, motors};
use motor_hub::model::load::Load;
use motor_hub::motor::Settings;
use motor_hub::regulator::Dynamics;
use motor_hub::units::{Acceleration, Millivolts};
use simulated::hardware::{BRIDGE, mechanics, winding};

/// Proposed acceleration, as a share of the acceleration that the battery gives a motor at rest.
const SHARE: f64 = 0.5;

/// Returns the present settings with these dynamics and the acceleration limit that is proposed for them.
pub fn proposal(before: &MotorSettings, dynamics: &Dynamics, battery: Millivolts) -> MotorSettings {
    let volts = f64::from(battery.get().saturating_sub(dynamics.friction.get())) / 1e3;
    let limit = SHARE * volts * f64::from(dynamics.gain.to_f32());
    let acceleration = Acceleration::new(limit.round().max(1.0) as u32).ok();
    let motor = Settings { dynamics: Some(*dynamics), acceleration, ..before.motor };
    MotorSettings { motor, ..*before }
}

/// Finds the catalogue motor with the configured winding, and its dynamics without a load. `None` if the catalogue has
/// no such motor.
pub fn catalogue_motor(settings: &Settings) -> Option<(Motor, Dynamics)> {
    let (motor, winding) = motors().find_map(|motor| {
        let winding = winding(&motor).ok()?;
        (winding == settings.winding).then_some((motor, winding))
    })?;
    let bare = motor.with_measured_rotor_inertia();
    Some((motor, Dynamics::from_mechanics(&winding, &BRIDGE, &mechanics(&bare, &Load::NONE)).ok()?))
}

/// Inertia with load, divided by the inertia of the bare motor: the inverse ratio of their accelerations per volt.
pub fn inertia_ratio(bare: &Dynamics, found: &Dynamics) -> f64 {
    f64::from(bare.gain.to_f32()) / f64::from(found.gain.to_f32())
}
