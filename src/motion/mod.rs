//! From a set-point to a control value: velocity from encoder counts, the PID loops, and a watch on
//! the encoder that they trust.
//!
//! ```
//! use motor_hub::motion::{Tracker, VelocityEstimator};
//! use motor_hub::units::{Micros, Period};
//!
//! // A counter that wraps, read every 50 ms: 15 counts in that time are 300 counts/s.
//! let mut encoder = Tracker::default();
//! let mut velocity = VelocityEstimator::new(Period::DEFAULT);
//! velocity.step(encoder.step(65_530, Micros::new(0)));
//! let reading = encoder.step(9, Micros::new(50_000));
//! assert_eq!((reading.position, velocity.step(reading).round()), (15, 300));
//! ```

pub mod encoder;
pub mod guard;
pub mod newest;
pub mod pid;
pub mod velocity;

pub use encoder::{Reading, Tracker};
pub use guard::{EncoderFault, Guard};
pub use newest::Newest;
pub use pid::{Pid, Pidf};
pub use velocity::VelocityEstimator;
