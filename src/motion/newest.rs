//! The newest encoder samples and speeds of all motors, for readers between two ticks.
//!
//! ```
//! use motor_hub::motion::{Newest, Tracker};
//! use motor_hub::units::{CountsPerSecond, Micros};
//!
//! let (mut newest, mut encoder) = (Newest::<1>::new(), Tracker::default());
//! let at = Micros::new(151_000);
//! newest.readings = [Some(encoder.step(0, at))];
//! newest.set_velocities([CountsPerSecond::new(2_000)].into_iter());
//! let tick = Micros::new(150_000);
//! assert_eq!(newest.newer_than(0, tick), Some((0, Some(CountsPerSecond::new(2_000)))));
//! ```

use super::Reading;
use crate::units::{CountsPerSecond, Micros};

/// The newest encoder samples, and the speeds that the observers estimate from them.
#[derive(Clone, Debug)]
pub struct Newest<const N: usize> {
    /// Newest sample of each encoder; `None` before the first sample. An encoder without a new sample keeps its last
    /// sample.
    pub readings: [Option<Reading>; N],
    velocities: [Option<CountsPerSecond>; N],
}

impl<const N: usize> Newest<N> {
    /// Creates a store without samples and speeds.
    pub const fn new() -> Self {
        Self { readings: [None; N], velocities: [None; N] }
    }

    /// Takes the speeds that the observers estimate, in the order of the motors.
    pub fn set_velocities(&mut self, velocities: impl Iterator<Item = CountsPerSecond>) {
        for (last, new) in self.velocities.iter_mut().zip(velocities) {
            *last = Some(new);
        }
    }

    /// The position of a motor in counts, and its speed. `None` without such a motor, or without a sample newer than
    /// `tick`. The speed is `None` before the first call of [`set_velocities`](Self::set_velocities), as on a board that estimates
    /// speeds at ticks only.
    pub fn newer_than(&self, motor: usize, tick: Micros) -> Option<(i32, Option<CountsPerSecond>)> {
        let new = (*self.readings.get(motor)?).filter(|new| new.at > tick)?;
        Some((new.position, self.velocities.get(motor).copied().flatten()))
    }
}

impl<const N: usize> Default for Newest<N> {
    fn default() -> Self {
        Self::new()
    }
}
