//! From a set-point to a control value: velocity from encoder counts, and the PID loops.

pub mod encoder;
pub mod pid;
pub mod velocity;

pub use encoder::{Reading, Tracker};
pub use pid::{Pid, Pidf, Tick};
pub use velocity::VelocityEstimator;
