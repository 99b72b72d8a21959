//! The record of faults: the last faults and resets, in memory that survives a reset.
//!
//! ```text
//! reset cause, at start-----------> +--------+ --heads, ticks--> responder
//! control --Snapshot, every tick--> | Record |
//! fault handlers --CrashReport----> +--------+ read at the next start
//! ```
//!
//! Terms:
//! * A *run* is the time from one reset to the next.
//! * A [`Tick`] is the state of one motor at one control tick. A ring holds the last [`TICKS`] ticks of each motor.
//! * A [`Head`] describes one fault or reset. A head, with its ticks if the record still has them, is an *entry*.
//! * A *page* holds the ticks of one entry: a copy of the ring's ticks of the entry's motor.
//!
//! An entry is written when a fault of a motor begins, and at the start after a run has ended. A repetition of the
//! newest entry is counted in that entry. The record keeps the newest [`HEADS`] heads, and pages for the newest
//! [`PAGES`] entries.
//!
//! A reset may interrupt a write at any byte, and the memory has random content after power-on. Therefore heads, pages
//! and the state of the run have checksums, and the record ignores content with a wrong checksum.
//!
//! ```
//! use motor_hub::hub::Snapshot;
//! use motor_hub::record::{Fault, Record, SIZE};
//!
//! let mut memory = [0x5A; SIZE];
//! // The memory has random content after power-on, so the record is empty.
//! let (mut record, mut crash_report) = Record::open(&mut memory, Fault::PowerOn);
//! assert_eq!(record.heads().count(), 0);
//! record.tick(&Snapshot::<4>::INITIAL);
//! crash_report.store(Fault::Panic, [120, 5]);
//!
//! // The watchdog then resets the chip.
//! let (record, _) = Record::open(&mut memory, Fault::Watchdog);
//! let head = record.heads().next().unwrap();
//! assert_eq!((head.fault, head.detail, head.run), (Fault::Panic, [120, 5], 1));
//! ```

mod entry;
mod fault;
mod live;

pub use entry::{Head, Tick};
pub(crate) use entry::{NO_MOTOR, drive_bits, drive_of};
pub use fault::Fault;
pub use live::CrashReport;

use crate::bridge::{Drive, Mode};
use crate::hub::Snapshot;
use crate::motor::{Report, Setpoint};
use entry::{HEAD, TICK, checksum};
use live::{CRASH_REPORT_BYTES, LIVE_BYTES, RunState};

/// Size of the record's memory in bytes.
pub const SIZE: usize = 4096;

/// Number of heads that the record keeps.
pub const HEADS: usize = 8;

/// Number of entries with ticks. Older entries have only a head.
pub const PAGES: usize = 3;

/// Number of ticks that the record keeps of each motor.
pub const TICKS: usize = 64;

/// Number of motors, from motor 0, whose ticks and faults are recorded. Faults of further motors are not recorded.
pub const MOTORS: usize = 4;

/// Number of slots in the ring: one more than [`TICKS`], because a reset may leave the slot that is being written
/// incomplete.
const SLOTS: usize = TICKS + 1;
/// Size of a slot of the ring in bytes: one tick of each motor.
const SLOT: usize = MOTORS * TICK;
/// Size of a page in bytes.
const PAGE: usize = TICKS * TICK;
const _: () = assert!(LIVE_BYTES + CRASH_REPORT_BYTES + SLOTS * SLOT + HEADS * HEAD + PAGES * PAGE <= SIZE);

/// The fault record, in borrowed memory.
#[derive(Debug)]
pub struct Record<'a> {
    /// State of the present run, in memory that survives a reset.
    live: &'a mut [[u8; 4]],
    /// Copy of the state in `live`.
    state: RunState,
    ring: &'a mut [[u8; SLOT]],
    /// The head of entry n is at index n modulo [`HEADS`].
    heads: &'a mut [[u8; HEAD]],
    /// The page of entry n is at index n modulo [`PAGES`].
    pages: &'a mut [[u8; PAGE]],
    /// Number of the newest entry; `None` without an entry. The first entry has number 1, and 0 follows 65 535.
    newest: Option<u16>,
    /// Faults of each motor at the last tick, as [bits](fault_bits).
    last_faults: [u8; MOTORS],
}

impl<'a> Record<'a> {
    /// Opens the record after a reset with this cause.
    ///
    /// If the memory holds an earlier run, the end of that run becomes an entry. The fault of this entry is the fault
    /// that a handler has stored in the [`CrashReport`], or else the reset cause. If the memory holds no run, all
    /// entries are deleted.
    #[inline(never)]
    pub fn open(memory: &'a mut [u8; SIZE], cause: Fault) -> (Self, CrashReport<'a>) {
        let (live, rest) = memory.split_at_mut(LIVE_BYTES);
        let (words, rest) = rest.split_at_mut(CRASH_REPORT_BYTES);
        let (ring, rest) = rest.split_at_mut(SLOTS * SLOT);
        let (heads, pages) = rest.split_at_mut(HEADS * HEAD);
        let mut record = Self {
            live: live.as_chunks_mut().0,
            state: RunState::default(),
            ring: ring.as_chunks_mut().0,
            heads: heads.as_chunks_mut().0,
            pages: pages.as_chunks_mut().0,
            newest: None,
            last_faults: [0; MOTORS],
        };
        let mut crash_report = CrashReport(words.as_chunks_mut().0);
        let reported = crash_report.take();
        match RunState::read(record.live) {
            Some(ended) => {
                record.state = ended;
                record.newest = record.newest_in_memory();
                let (fault, detail) = reported.unwrap_or((cause, [0; 2]));
                let motor = record.most_driven();
                let drive = motor.map_or(Drive::COAST, |motor| record.drive_ago(motor, 1));
                record.write(fault, detail, motor, drive);
            }
            None => record.clear(),
        }
        record.state = RunState::begin(record.live, record.state.run.wrapping_add(1));
        (record, crash_report)
    }

    /// Deletes all entries. The present run continues.
    pub fn clear(&mut self) {
        self.heads.as_flattened_mut().fill(0);
        self.newest = None;
    }

    /// Records one control tick of all motors, and writes an entry for each fault that begins. Must be called at each
    /// tick.
    pub fn tick<const N: usize>(&mut self, snapshot: &Snapshot<N>) {
        let slot = self.ring.get_mut(usize::from(self.state.next)).map(|slot| slot.as_chunks_mut().0);
        for (bytes, report) in slot.into_iter().flatten().zip(&snapshot.motors) {
            *bytes = Tick::of(report).to_bytes();
        }
        self.state = RunState {
            run: self.state.run,
            // In units of 1024 us, because a 64-bit division by 1000 at each tick would be slow.
            time: (snapshot.at.get() / 1024) as u32,
            battery: snapshot.battery,
            next: (self.state.next + 1) % SLOTS as u8,
            filled: (self.state.filled + 1).min(TICKS as u8),
        };
        self.state.store(self.live);
        for (motor, report) in snapshot.motors.iter().enumerate() {
            let Some(last) = self.last_faults.get_mut(motor) else { break };
            let present = fault_bits(report);
            let new = present & !*last;
            *last = present;
            if new != 0 {
                self.record_faults(motor, new);
            }
        }
    }

    /// Returns the number of the present run. The first run of a record has number 1.
    pub const fn run(&self) -> u32 {
        self.state.run
    }

    /// Iterates over the heads of the entries, newest first, at most [`HEADS`]. Damaged heads are left out. A head
    /// whose ticks the record has lost has 0 ticks.
    pub fn heads(&self) -> impl Iterator<Item = Head> {
        (0..HEADS as u16).filter_map(|age| {
            let (head, sum) = self.head(self.newest?.wrapping_sub(age))?;
            let ticks = if self.page(&head, sum).is_some() { head.ticks } else { 0 };
            Some(Head { ticks, ..head })
        })
    }

    /// Iterates over the ticks of the entry with this number, oldest first. `None` if the entry does not exist, or if
    /// its ticks are missing, damaged or overwritten.
    pub fn ticks(&self, number: u16) -> Option<impl ExactSizeIterator<Item = Tick>> {
        let (head, sum) = self.head(number)?;
        Some(self.page(&head, sum)?.iter().map(|bytes| Tick::from_bytes(*bytes)))
    }

    /// Writes an entry for each new fault of a motor.
    #[cold]
    fn record_faults(&mut self, motor: usize, new: u8) {
        // The fault may have changed the command of this tick. The command of the tick before is the last command
        // without the fault.
        let drive = self.drive_ago(motor, 2);
        for fault in Fault::in_bits(new) {
            self.write(fault, [0; 2], Some(motor), drive);
        }
    }

    /// Writes an entry for a fault or a reset. A repetition of the newest entry is counted in that entry instead.
    ///
    /// `drive` is the last command to the bridge of `motor` before the fault.
    fn write(&mut self, fault: Fault, detail: [u32; 2], motor: Option<usize>, drive: Drive) {
        let index = motor.map(|motor| motor as u8);
        if let Some((head, sum)) = self.newest.and_then(|number| self.head(number)).filter(|(head, _)| {
            // All motors share one battery, so an unknown battery is recorded once and not once per motor.
            let same_motor = head.motor == index || fault == Fault::BatteryUnknown;
            let repeated = head.fault == fault && head.detail == detail && same_motor;
            // A hub that resets repeatedly before its first tick fills one entry only, so older entries are kept.
            let both_without_ticks = self.state.filled == 0 && head.ticks == 0;
            repeated && (head.run == self.state.run as u16 || both_without_ticks)
        }) {
            return self.put(Head { times: head.times.saturating_add(1), ..head }, sum);
        }
        let number = self.newest.map_or(1, |newest| newest.wrapping_add(1));
        self.newest = Some(number);
        let (ticks, sum) = motor.map_or((0, 0), |motor| self.copy(motor, number));
        let RunState { time, battery, .. } = self.state;
        let head = Head {
            number,
            fault,
            times: 1,
            run: self.state.run as u16,
            // A unit of `time` is 1024 us, which is 128/125 ms.
            uptime_ms: (u64::from(time) * 128 / 125) as u32,
            battery,
            motor: index,
            drive,
            detail,
            ticks,
        };
        self.put(head, sum);
    }

    /// Stores a head with the checksum of its ticks.
    fn put(&mut self, head: Head, sum: u32) {
        if let Some(bytes) = self.heads.get_mut(usize::from(head.number) % HEADS) {
            *bytes = head.to_bytes(sum);
        }
    }

    /// Copies the ticks of a motor from the ring to the page of the entry with this number. Returns the number of ticks
    /// and their checksum.
    fn copy(&mut self, motor: usize, number: u16) -> (u8, u32) {
        let RunState { next, filled, .. } = self.state;
        let Some(page) = self.pages.get_mut(usize::from(number) % PAGES) else { return (0, 0) };
        let first = (usize::from(next) + SLOTS - usize::from(filled)) % SLOTS;
        let slots = self.ring.iter().cycle().skip(first).take(filled.into());
        let ticks = slots.filter_map(|slot| slot.as_chunks::<TICK>().0.get(motor));
        let mut count = 0;
        for (bytes, tick) in page.as_chunks_mut().0.iter_mut().zip(ticks) {
            *bytes = *tick;
            count += 1;
        }
        let sum = page.get(..usize::from(count) * TICK).map_or(0, checksum);
        (count, sum)
    }

    /// Returns the head with this number and the checksum of its ticks. `None` if the head is damaged or overwritten.
    fn head(&self, number: u16) -> Option<(Head, u32)> {
        let (head, sum) = Head::from_bytes(self.heads.get(usize::from(number) % HEADS)?)?;
        (head.number == number).then_some((head, sum))
    }

    /// Returns the number of the newest head in memory. `None` if the memory holds no sound head.
    fn newest_in_memory(&self) -> Option<u16> {
        let numbers = self.heads.iter().filter_map(Head::from_bytes).map(|(head, _)| head.number);
        numbers.reduce(|one, other| if is_after(other, one) { other } else { one })
    }

    /// Returns the ticks of an entry, as bytes. `None` if the entry has no ticks, if its page is damaged, or if a newer
    /// entry has overwritten the page.
    fn page(&self, head: &Head, sum: u32) -> Option<&[[u8; TICK]]> {
        let page = self.pages.get(usize::from(head.number) % PAGES)?;
        let ticks = page.get(..usize::from(head.ticks) * TICK).filter(|ticks| !ticks.is_empty())?;
        (checksum(ticks) == sum).then_some(ticks.as_chunks().0)
    }

    /// Returns the command to a motor's bridge `ago` ticks ago; 1 is the last tick. [`Drive::COAST`] if the run has
    /// fewer ticks than `ago`.
    fn drive_ago(&self, motor: usize, ago: usize) -> Drive {
        let slot = (usize::from(self.state.next) + SLOTS - ago) % SLOTS;
        let slot = self.ring.get(slot).filter(|_| ago <= usize::from(self.state.filled));
        let tick = slot.and_then(|slot| slot.as_chunks().0.get(motor));
        tick.map_or(Drive::COAST, |bytes| Tick::from_bytes(*bytes).drive)
    }

    /// Returns the driven motor with the largest duty at the last tick. If no motor was driven, returns the braked
    /// motor with the largest duty. `None` if all motors coasted.
    fn most_driven(&self) -> Option<usize> {
        let driven = (0..MOTORS).filter(|motor| self.drive_ago(*motor, 1) != Drive::COAST);
        driven.max_by_key(|motor| {
            let Drive { mode, duty } = self.drive_ago(*motor, 1);
            (mode != Mode::Brake50, duty.to_bits())
        })
    }
}

/// Returns true if entry number `one` is newer than `other`. Entry numbers wrap.
const fn is_after(one: u16, other: u16) -> bool {
    one.wrapping_sub(other) as i16 > 0
}

/// Returns the faults of a motor as bits. The result is 0 for a motor that is disabled or in its fail-safe state,
/// because then a fault ends no set-point of a host.
fn fault_bits(report: &Report) -> u8 {
    match report.setpoint {
        Setpoint::Disabled | Setpoint::FailSafe => 0,
        _ => Fault::bits_of(report.faults),
    }
}
