//! Replaces the motor of a scenario by another motor, and scales the run to what the other motor can do.

use super::types::{Motor, Timed};
use motor_hub::model::train::Train;
use motor_hub::model::{catalogue, si};
use motor_hub::motor::{Setpoint, ThermalLimit};
use motor_hub::units::{Acceleration, CountsPerSecond, Milliamperes};
use std::num::NonZeroU16;

/// What a motor can do at 12 V.
struct Reach {
    /// Free speed in counts per second.
    free_cps: f64,
    /// Free speed of the output shaft in rad/s.
    free_after: f64,
    /// Stall torque of the output shaft in newton metres.
    stall_after: f64,
    /// Stall current in amperes.
    stall_a: f64,
}

impl Reach {
    fn of(motor: &catalogue::Motor) -> Self {
        let (ke, kt) = (motor.ke.0, motor.kt.0);
        let free = 12.0 * kt / (motor.r.0 * motor.b.0 + ke * kt);
        Self {
            free_cps: free * motor.counts_per_rev_motor / std::f64::consts::TAU,
            free_after: free / motor.gear_ratio,
            stall_after: 12.0 / motor.r.0 * kt * motor.gear_ratio * motor.eta,
            stall_a: 12.0 / motor.r.0,
        }
    }
}

impl Motor {
    /// Returns the same task for another motor. Speeds and positions scale with the free speeds; torques, friction and
    /// cogging scale with the stall torques; currents and their limits scale with the stall currents. Loads and trains
    /// scale so that they accelerate and twist in the same time. Coefficients are removed, so that the model regulates
    /// the other motor.
    #[must_use]
    pub fn with_constants(&self, constants: catalogue::Motor) -> Self {
        let (old, new) = (Reach::of(&self.constants), Reach::of(&constants));
        let counts = new.free_cps / old.free_cps;
        let torque = new.stall_after / old.stall_after;
        let angle = new.free_after / old.free_after;
        let load = torque * old.free_after / new.free_after;
        let current = new.stall_a / old.stall_a;
        let mut motor = Self { constants, velocity: None, position: None, ..self.clone() };
        let [was, is] = [&self.constants, &constants].map(|motor| motor.stall_torque(si::Volts(12.0)).0);
        (motor.constants.friction, motor.constants.cogging) =
            (self.constants.friction, self.constants.cogging);
        let catalogue::Motor { friction, cogging, .. } = &mut motor.constants;
        for part in [&mut friction.coulomb, &mut friction.breakaway, &mut cogging.amplitude] {
            part.0 *= is / was;
        }
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
