//! Positions from wrapping encoder counters, and the PID loop.

pub mod encoder;
pub mod newest;
pub mod pid;

pub use encoder::{Reading, Tracker};
pub use newest::Newest;
pub use pid::{Pid, Pidf};
