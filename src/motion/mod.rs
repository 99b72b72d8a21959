//! Positions from wrapping encoder counters, and the PID loop.
//!
//! ```
//! use motor_hub::motion::Tracker;
//! use motor_hub::units::Micros;
//!
//! // A counter that wraps.
//! let mut encoder = Tracker::default();
//! encoder.step(65_530, Micros::new(0));
//! let reading = encoder.step(9, Micros::new(1_000));
//! assert_eq!((reading.position, reading.edge_at), (15, Micros::new(1_000)));
//! ```

pub mod encoder;
pub mod newest;
pub mod pid;

pub use encoder::{Reading, Tracker};
pub use newest::Newest;
pub use pid::{Pid, Pidf};
