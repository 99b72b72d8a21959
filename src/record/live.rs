//! What is told of the present run while it lasts, so that the next one knows how it ended.

use super::entry::checksum;
use super::{Fault, SLOTS, TICKS};
use crate::units::Millivolts;

/// Of this layout.
const MAGIC: u32 = 0x3152_484D;

/// [`MAGIC`], the run's number and its complement; then time, the rest of [`Now`], and both against each other.
const RUN: usize = 0;
const NOW: usize = 3;

/// Bytes.
pub(super) const LIVE: usize = 6 * 4;
pub(super) const WORDS: usize = 4 * 4;

#[derive(Debug)]
pub(super) struct Live<'a>(pub(super) &'a mut [[u8; 4]]);

/// The place for what ends the present run, apart from the record: whoever fails may have been busy with that.
#[derive(Debug)]
pub struct LastWords<'a>(pub(super) &'a mut [[u8; 4]]);

/// As of the last tick.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Now {
    /// Since the run began, in units of 1024 us.
    pub(super) time: u32,
    pub(super) battery: Option<Millivolts>,
    /// The ring's next slot, and how many before it hold ticks of this run.
    pub(super) next: u8,
    pub(super) filled: u8,
}

/// What a run left.
pub(super) struct Left {
    pub(super) run: u32,
    pub(super) now: Now,
}

impl Live<'_> {
    /// Of the run before; `None` if there was none.
    pub(super) fn left(&self) -> Option<Left> {
        let [magic, run, complement] = get(self.0, RUN);
        if magic != MAGIC || run != !complement {
            return None;
        }
        let [time, rest, check] = get(self.0, NOW);
        if check != time ^ rest ^ MAGIC {
            return Some(Left { run, now: Now::default() });
        }
        let [b, c, next, filled] = rest.to_le_bytes();
        let now = Now {
            time,
            battery: Some(Millivolts::new(u16::from_le_bytes([b, c]))).filter(|known| known.get() != 0),
            next: if usize::from(next) < SLOTS { next } else { 0 },
            filled: filled.min(TICKS as u8),
        };
        Some(Left { run, now })
    }

    /// A run begins.
    pub(super) fn begin(&mut self, run: u32) {
        // Whatever a reset leaves of this is no run, or this run.
        put(self.0, RUN, [0; 3]);
        self.tell(Now::default());
        put(self.0, RUN, [MAGIC, run, !run]);
    }

    pub(super) fn tell(&mut self, Now { time, battery, next, filled }: Now) {
        let [b, c] = battery.map_or(0, Millivolts::get).to_le_bytes();
        let rest = u32::from_le_bytes([b, c, next, filled]);
        put(self.0, NOW, [time, rest, time ^ rest ^ MAGIC]);
    }
}

impl LastWords<'_> {
    /// What ends the run, from a context that the run will not come back from.
    pub fn say(&mut self, fault: Fault, [first, second]: [u32; 2]) {
        let number = u32::from(fault.number());
        put(self.0, 0, [number, first, second, sum_of([number, first, second])]);
    }

    /// Those of the run before, which are forgotten.
    pub(super) fn take(&mut self) -> Option<(Fault, [u32; 2])> {
        let [number, first, second, sum] = get(self.0, 0);
        put(self.0, 0, [0; 4]);
        let number = u8::try_from(number).ok().filter(|_| sum == sum_of([number, first, second]))?;
        Some((Fault::from_number(number)?, [first, second]))
    }
}

fn get<const N: usize>(words: &[[u8; 4]], at: usize) -> [u32; N] {
    let mut words = words.iter().skip(at);
    core::array::from_fn(|_| words.next().map_or(0, |word| u32::from_le_bytes(*word)))
}

fn put<const N: usize>(words: &mut [[u8; 4]], at: usize, values: [u32; N]) {
    words.iter_mut().skip(at).zip(values).for_each(|(word, value)| *word = value.to_le_bytes());
}

fn sum_of(words: [u32; 3]) -> u32 {
    checksum(words.map(u32::to_le_bytes).as_flattened())
}
