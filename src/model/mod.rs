//! Physical model in `f64`: characterised motors, loads, the switching bridge with its catch diodes, and plants.
//! A *plant* is a motor with its load and its bridge, simulated over time. The model does not run on a microcontroller.
//!
//! Conventions of all modules:
//! * Clockwise (CW) is positive for speed, angle and torque.
//! * Positive motor current flows from the left terminal to the right terminal and makes CW torque.
//! * Positive battery current leaves the battery.
//! * A quantity whose name has `after` is after the gearbox, at the output shaft. All other quantities are at the motor
//!   shaft.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::response::GearedMotor;
//! use motor_hub::model::si::{Hertz, Volts};
//! use motor_hub::model::switching::{Bridge, Pwm};
//!
//! // At full duty on an ideal bridge the back EMF of a motor without load is almost the battery voltage.
//! let motor = characterised("AM 60 A")?;
//! let full = Pwm::new(Mode::Cw98, 1.0, Hertz(20_000.0));
//! let speed = GearedMotor::new(&motor, &Load::NONE).speed_at_duty(Bridge::IDEAL, full, Volts(12.0));
//! let emf = motor.ke.0 * speed.0;
//! assert!(10.0 < emf && emf < 12.0);
//! # Ok::<(), motor_hub::model::catalogue::UnknownMotor>(())
//! ```

pub mod battery;
pub mod bridge_states;
pub mod bus;
pub mod catalogue;
pub mod friction;
pub mod inverse;
pub mod load;
mod mechanics;
mod numeric;
pub mod paper;
pub mod periodic;
pub mod plant;
pub mod response;
pub mod rig;
pub mod si;
pub mod switching;
pub mod train;
