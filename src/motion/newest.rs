//! Where motors are and how fast they turn, as of the newest samples of their encoders: for whoever looks between two
//! ticks.
//!
//! ```
//! use motor_hub::motion::{Newest, Tracker};
//! use motor_hub::units::{CountsPerSecond, Micros};
//!
//! let (mut newest, mut encoder) = (Newest::<1>::new(), Tracker::default());
//! let at = Micros::new(151_000);
//! newest.sample(|readings| *readings = [Some(encoder.step(0, at))]);
//! newest.observe([CountsPerSecond::new(2_000)].into_iter());
//! let tick = Micros::new(150_000);
//! assert_eq!(newest.look(0, tick), Some((0, Some(CountsPerSecond::new(2_000)))));
//! ```

use super::Reading;
use crate::units::{CountsPerSecond, Micros};

/// The newest samples, and what observers make of them.
#[derive(Clone, Debug)]
pub struct Newest<const N: usize> {
    readings: [Option<Reading>; N],
    speeds: [Option<CountsPerSecond>; N],
}

impl<const N: usize> Newest<N> {
    /// Nothing is known.
    pub const fn new() -> Self {
        Self { readings: [None; N], speeds: [None; N] }
    }

    /// Takes a sample of all encoders, in its place: of one that is silent the last reading stays.
    pub fn sample(&mut self, read: impl FnOnce(&mut [Option<Reading>; N])) {
        read(&mut self.readings);
    }

    /// The newest samples.
    pub const fn readings(&self) -> &[Option<Reading>; N] {
        &self.readings
    }

    /// Takes the speeds that observers make of it.
    pub fn observe(&mut self, speeds: impl Iterator<Item = CountsPerSecond>) {
        for (last, new) in self.speeds.iter_mut().zip(speeds) {
            *last = Some(new);
        }
    }

    /// A motor's position in counts, and its speed if anybody observes that between two ticks. `None` if nothing is known
    /// of its encoder that is newer than the last tick.
    pub fn look(&self, motor: usize, tick: Micros) -> Option<(i32, Option<CountsPerSecond>)> {
        let new = (*self.readings.get(motor)?).filter(|new| new.at > tick)?;
        Some((new.position, self.speeds.get(motor).copied().flatten()))
    }
}

impl<const N: usize> Default for Newest<N> {
    fn default() -> Self {
        Self::new()
    }
}
