//! Physics in `f64`: characterised motors, their loads, the switching bridge with its catch diodes,
//! and plants for whole runs. Nothing here runs on a microcontroller.
//!
//! Sign conventions, everywhere: clockwise (CW) is positive; positive current flows from the left
//! terminal to the right one and makes CW torque; motor quantities are before the gearbox unless a
//! name says `after`; battery current is positive when it leaves the battery.

pub mod battery;
pub mod bridge_states;
pub mod catalogue;
pub mod inverse;
pub mod load;
mod numeric;
pub mod paper;
pub mod periodic;
pub mod plant;
pub mod response;
pub mod rig;
pub mod si;
pub mod switching;
