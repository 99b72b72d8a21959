//! Physics in `f64`: characterised motors, their loads, the switching bridge with its catch diodes,
//! and plants for whole runs. Nothing here runs on a microcontroller.
//!
//! Sign conventions, everywhere: clockwise (CW) is positive; positive current flows from the left
//! terminal to the right one and makes CW torque; motor quantities are before the gearbox unless a
//! name says `after`; battery current is positive when it leaves the battery.
//!
//! ```
//! use motor_hub::bridge::Mode;
//! use motor_hub::model::catalogue::characterised;
//! use motor_hub::model::load::Load;
//! use motor_hub::model::paper::OpenLoop;
//! use motor_hub::model::si::{Hertz, Volts};
//! use motor_hub::model::switching::{Bridge, Pwm};
//!
//! // On an ideal bridge at full duty a motor without load runs at almost the speed whose back EMF is 12 V.
//! let motor = characterised("AM 60 A")?;
//! let full = Pwm::new(Mode::Cw98, 1.0, Hertz(20_000.0));
//! let speed = OpenLoop::new(&motor, &Load::NONE, Bridge::IDEAL).steady_speed(full, Volts(12.0));
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
