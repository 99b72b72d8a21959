//! Where motors are and how fast they turn, as of the newest samples of their encoders: for whoever looks between two
//! ticks. What a look costs is spent by who looks: samples are many, looks are few.
//!
//! ```
//! use motor_hub::motion::{Newest, Tracker};
//! use motor_hub::units::{CountsPerSecond, Micros};
//!
//! let (mut newest, mut encoder) = (Newest::<1>::new(), Tracker::default());
//! for ms in 0..200 {
//!     // 2000 counts/s.
//!     newest.sample(|readings| *readings = [Some(encoder.step(2 * ms, Micros::new(1_000 * u64::from(ms))))]);
//! }
//! let (position, velocity) = newest.look(0, CountsPerSecond::ZERO, Micros::new(150_000)).expect("sampled");
//! assert_eq!((position, velocity.round()), (398, 2_000));
//! ```

use super::Reading;
use super::velocity::between;
use crate::units::{CountsPerSecond, Micros};

/// Every such sample is kept for the speed.
const SPACING: u8 = 10;

/// So many: at 1 kHz the speed is a mean of 40 to 50 ms, for which an edge's time is good to 2.5 %.
const KEPT: usize = 5;

/// The newest samples, and some before them.
#[derive(Clone, Debug)]
pub struct Newest<const N: usize> {
    last: [Option<Reading>; N],
    /// Speeds of motors that are known, by their observers.
    observed: [Option<CountsPerSecond>; N],
    kept: [[Option<Reading>; N]; KEPT],
    /// The oldest of them.
    oldest: usize,
    /// Samples until the next is kept.
    wait: u8,
}

impl<const N: usize> Newest<N> {
    /// Nothing is known.
    pub const fn new() -> Self {
        Self { last: [None; N], observed: [None; N], kept: [[None; N]; KEPT], oldest: 0, wait: 0 }
    }

    /// Takes a sample of all encoders, in its place: of one that is silent the last reading stays.
    pub fn sample(&mut self, read: impl FnOnce(&mut [Option<Reading>; N])) {
        read(&mut self.last);
        if self.wait > 0 {
            self.wait -= 1;
            return;
        }
        self.wait = SPACING - 1;
        if let Some(oldest) = self.kept.get_mut(self.oldest) {
            *oldest = self.last;
        }
        self.oldest = (self.oldest + 1) % KEPT;
    }

    /// The newest samples.
    pub const fn readings(&self) -> &[Option<Reading>; N] {
        &self.last
    }

    /// Takes the speeds that observers make of it.
    pub fn observe(&mut self, observed: impl Iterator<Item = Option<CountsPerSecond>>) {
        for (last, new) in self.observed.iter_mut().zip(observed) {
            *last = new;
        }
    }

    /// A motor's position in counts, and its speed: of a motor that is known, by its observer; else the mean of the last
    /// 40 to 50 ms. `before` is what was estimated before, at the last tick: of a motor that has not moved since, the most
    /// that is left of it. `None` if nothing is known of its encoder that is newer than `tick`, the time of that.
    pub fn look(
        &self,
        motor: usize,
        before: CountsPerSecond,
        tick: Micros,
    ) -> Option<(i32, CountsPerSecond)> {
        let new = (*self.last.get(motor)?).filter(|new| new.at > tick)?;
        let observed = self.observed.get(motor).copied().flatten();
        let counted = || {
            let old = (0..KEPT)
                .find_map(|age| *self.kept.get((self.oldest + age) % KEPT)?.get(motor)?)
                .and_then(|old| between(old, new, before));
            old.map_or(before, CountsPerSecond::saturating_from_bits)
        };
        Some((new.position, observed.unwrap_or_else(counted)))
    }
}

impl<const N: usize> Default for Newest<N> {
    fn default() -> Self {
        Self::new()
    }
}
