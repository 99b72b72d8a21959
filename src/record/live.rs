//! State of the present run, in memory that survives a reset. The hub writes the state at every tick. The next run
//! reads the state, and records how this run ended.

use super::entry::checksum;
use super::{Fault, SLOTS, TICKS};
use crate::units::Millivolts;

/// Marks memory that holds a record of this layout: "MHR2" in ASCII.
const MAGIC: u32 = 0x3252_484D;

/// Index of the first of three words about the run. The words are [`MAGIC`], the number of the run, and the complement
/// of that number.
const RUN_INDEX: usize = 0;
/// Index of the first of three words about the last tick. The words are the time, then battery, `next` and `filled` in
/// one word, and a check word.
///
/// The check word is the exclusive or of the two words before it and [`MAGIC`].
const TICK_INDEX: usize = 3;

/// Size of the memory of a [`RunState`], in bytes.
pub(super) const LIVE_BYTES: usize = 6 * 4;
/// Size of the memory that [`CrashReport`] borrows, in bytes.
pub(super) const CRASH_REPORT_BYTES: usize = 4 * 4;

/// Memory in which a fault handler reports the fault that ends the present run.
///
/// The memory is separate from [`Record`](super::Record), because the fault may interrupt a write to the record.
#[derive(Debug)]
pub struct CrashReport<'a>(pub(super) &'a mut [[u8; 4]]);

/// A run, and its state at its last tick.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RunState {
    /// Number of the run.
    pub(super) run: u32,
    /// Time since the run began, in units of 1024 us.
    pub(super) time: u32,
    /// Battery voltage; `None` if the voltage is unknown.
    pub(super) battery: Option<Millivolts>,
    /// Index of the next slot to write, in the record's ring of ticks.
    pub(super) next: u8,
    /// Number of slots before `next`, around the ring, that hold ticks of this run. At most [`TICKS`].
    pub(super) filled: u8,
}

impl RunState {
    /// Reads the run before the reset from its memory; `None` if the memory holds no run. If the check word is wrong,
    /// only the number of the run is valid, and all other values are 0.
    pub(super) fn read(memory: &[[u8; 4]]) -> Option<Self> {
        let [magic, run, complement] = get(memory, RUN_INDEX);
        if magic != MAGIC || run != !complement {
            return None;
        }
        let [time, packed, check] = get(memory, TICK_INDEX);
        if check != time ^ packed ^ MAGIC {
            return Some(Self { run, ..Self::default() });
        }
        let [b, c, next, filled] = packed.to_le_bytes();
        Some(Self {
            run,
            time,
            battery: Some(Millivolts::new(u16::from_le_bytes([b, c]))).filter(|known| known.get() != 0),
            next: if usize::from(next) < SLOTS { next } else { 0 },
            filled: filled.min(TICKS as u8),
        })
    }

    /// Begins the run with this number in the memory, and returns its state.
    pub(super) fn begin(memory: &mut [[u8; 4]], run: u32) -> Self {
        let state = Self { run, ..Self::default() };
        // The words about the run are deleted first and written last. If a reset comes between these two writes, the
        // memory holds no run instead of a wrong run.
        put(memory, RUN_INDEX, [0; 3]);
        state.store(memory);
        put(memory, RUN_INDEX, [MAGIC, run, !run]);
        state
    }

    /// Stores the state at the present tick in the memory, without the number of the run.
    pub(super) fn store(&self, memory: &mut [[u8; 4]]) {
        let Self { time, battery, next, filled, .. } = *self;
        let [b, c] = battery.map_or(0, Millivolts::get).to_le_bytes();
        let packed = u32::from_le_bytes([b, c, next, filled]);
        put(memory, TICK_INDEX, [time, packed, time ^ packed ^ MAGIC]);
    }
}

impl CrashReport<'_> {
    /// Stores the fault that ends the run, and its [detail](super::Head::detail).
    ///
    /// A fault handler calls this before the reset. The next start of the hub makes an entry of the fault, if the
    /// memory still holds a valid run.
    pub fn store(&mut self, fault: Fault, [first, second]: [u32; 2]) {
        let number = u32::from(fault.number());
        put(self.0, 0, [number, first, second, sum_of([number, first, second])]);
    }

    /// Reads and deletes the fault that ended the previous run. `None` if there is no valid report.
    pub(super) fn take(&mut self) -> Option<(Fault, [u32; 2])> {
        let [number, first, second, sum] = get(self.0, 0);
        put(self.0, 0, [0; 4]);
        let number = u8::try_from(number).ok().filter(|_| sum == sum_of([number, first, second]))?;
        Some((Fault::from_number(number)?, [first, second]))
    }
}

/// Reads `N` words from index `at`.
fn get<const N: usize>(words: &[[u8; 4]], at: usize) -> [u32; N] {
    let mut words = words.iter().skip(at);
    core::array::from_fn(|_| words.next().map_or(0, |word| u32::from_le_bytes(*word)))
}

/// Writes `N` words from index `at`.
fn put<const N: usize>(words: &mut [[u8; 4]], at: usize, values: [u32; N]) {
    words.iter_mut().skip(at).zip(values).for_each(|(word, value)| *word = value.to_le_bytes());
}

/// Returns the checksum of three words.
fn sum_of(words: [u32; 3]) -> u32 {
    checksum(words.map(u32::to_le_bytes).as_flattened())
}
