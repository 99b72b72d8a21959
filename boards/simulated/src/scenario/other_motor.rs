//! Replaces the motor of a scenario by another motor, and scales the run to what the other motor can do.

use super::types::{Motor, Timed};
use motor_hub::model::train::Train;
use motor_hub::model::{catalogue, si};
use motor_hub::motor::{Setpoint, ThermalLimit};
use motor_hub::units::{Acceleration, CountsPerSecond, Milliamperes};
use std::f64::consts::TAU;
use std::num::NonZeroU16;

/// Voltage at which the motors are compared.
const VOLTS: si::Volts = si::Volts(12.0);

impl Motor {
    /// Returns the same task for another motor. Speeds and positions scale with the free speeds; torques, friction and
    /// cogging scale with the stall torques; currents and their limits scale with the stall currents. Loads and trains
    /// scale so that they accelerate and twist in the same time. Coefficients are removed, so that the model regulates
    /// the other motor.
    #[must_use]
    pub fn with_constants(&self, constants: catalogue::Motor) -> Self {
        let ratio = |of: fn(&catalogue::Motor) -> f64| of(&constants) / of(&self.constants);
        let motor_torque = ratio(|motor| motor.stall_torque(VOLTS).0);
        let current = ratio(|motor| VOLTS.0 / motor.r.0);
        let torque = ratio(|motor| VOLTS.0 / motor.r.0 * motor.kt.0 * motor.gear_ratio * motor.eta);
        let counts = ratio(|motor| motor.free_speed(VOLTS).0 * motor.counts_per_rev_motor / TAU);
        let free_after = |motor: &catalogue::Motor| motor.free_speed(VOLTS).0 / motor.gear_ratio;
        let angle = free_after(&constants) / free_after(&self.constants);
        let load = torque * free_after(&self.constants) / free_after(&constants);
        let catalogue::Motor { mut friction, mut cogging, .. } = self.constants;
        for part in [&mut friction.coulomb, &mut friction.breakaway, &mut cogging.amplitude] {
            part.0 *= motor_torque;
        }
        let constants = catalogue::Motor { friction, cogging, ..constants };
        let mut motor = Self { constants, velocity: None, position: None, ..self.clone() };
        motor.load.inertia_after = si::KgM2(self.load.inertia_after.0 * load);
        motor.load.drag_after = si::Drag(self.load.drag_after.0 * load);
        if let Some(Train { backlash_after, stiffness_after, damping_after }) = &mut motor.train {
            *backlash_after *= angle;
            *stiffness_after *= load;
            *damping_after *= load;
        }
        // The casts saturate. A limit that would be 0 is 1.
        let milliamperes = |limit: u16| ((f64::from(limit) * current).round() as u16).max(1);
        motor.current_limit = self.current_limit.and_then(|limit| NonZeroU16::new(milliamperes(limit.get())));
        motor.thermal = self.thermal.and_then(|limit| {
            ThermalLimit::new(milliamperes(limit.continuous_ma()), limit.winding_s(), limit.case_s()).ok()
        });
        motor.acceleration = self.acceleration.and_then(|limit| {
            Acceleration::new(((f64::from(limit.get()) * counts).round() as u32).max(1)).ok()
        });
        for Timed { value, .. } in &mut motor.setpoints {
            *value = scaled(*value, counts, current);
        }
        for Timed { value, .. } in &mut motor.torques {
            *value *= torque;
        }
        motor
    }
}

fn scaled(setpoint: Setpoint, counts: f64, currents: f64) -> Setpoint {
    let speed = |cps: CountsPerSecond| CountsPerSecond::new((cps.to_f64() * counts).round() as i32);
    match setpoint {
        // The hub sets the references of a group.
        Setpoint::Disabled | Setpoint::FailSafe | Setpoint::ConstantPower(_) | Setpoint::Follow(_) => {
            setpoint
        }
        Setpoint::Current { current, speed_limit } => {
            let current = Milliamperes::new((f64::from(current.get()) * currents).round() as i32);
            Setpoint::Current { current, speed_limit: speed(speed_limit) }
        }
        Setpoint::Velocity(cps) => Setpoint::Velocity(speed(cps)),
        Setpoint::Position { target, tolerance, speed_limit } => Setpoint::Position {
            target: (f64::from(target) * counts).round() as i32,
            tolerance: ((f64::from(tolerance) * counts).round() as u16).max(1),
            speed_limit: speed(speed_limit),
        },
        // The cast saturates at `u32::MAX`, which means no limit.
        Setpoint::Identify { travel_limit } => {
            Setpoint::Identify { travel_limit: (f64::from(travel_limit) * counts) as u32 }
        }
    }
}
