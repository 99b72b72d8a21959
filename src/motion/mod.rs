//! From a set-point to a control value: velocity from encoder counts, the PID loops, and a watch on
//! the encoder that they trust.

pub mod encoder;
pub mod guard;
pub mod pid;
pub mod velocity;

pub use encoder::{Reading, Tracker};
pub use guard::{EncoderFault, Guard};
pub use pid::{Pid, Pidf};
pub use velocity::VelocityEstimator;
