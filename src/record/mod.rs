//! What happened: the last faults and resets, in memory that a reset leaves alone.
//!
//! ```text
//! reset cause, at start-----------> +--------+ --heads, ticks--> responder
//! control --Snapshot, every tick--> | Record |
//! fault handlers --LastWords------> +--------+ at the next start
//! ```
//!
//! Of the last 64 ticks of each motor a ring is kept. When a motor's fault sets in, and when a run has ended, a
//! [`Head`] is written, and the ring of the motor concerned is copied beside it. Whatever ends a run may stop a write at
//! any byte, and memory holds anything after power-on: what is found is believed only with its checksum.
//!
//! Of the newest [`HEADS`] the heads are kept, of the newest [`PAGES`] the ticks too.
//!
//! ```
//! use motor_hub::hub::Snapshot;
//! use motor_hub::record::{Fault, Record, SIZE};
//!
//! let mut memory = [0x5A; SIZE];
//! // What memory holds after power-on is no record.
//! let (mut record, mut last_words) = Record::open(&mut memory, Fault::PowerOn);
//! assert_eq!(record.heads().count(), 0);
//! record.tick(&Snapshot::<4>::INITIAL);
//! last_words.say(Fault::Panic, [120, 5]);
//!
//! // The watchdog then starts the chip afresh.
//! let (record, _) = Record::open(&mut memory, Fault::Watchdog);
//! let head = record.heads().next().unwrap();
//! assert_eq!((head.fault, head.detail, head.run), (Fault::Panic, [120, 5], 1));
//! ```

mod entry;
mod fault;
mod live;

pub use entry::{Head, Tick};
pub(crate) use entry::{NOBODY, drive_bits, drive_of};
pub use fault::Fault;
pub use live::LastWords;

use crate::bridge::{Drive, Mode};
use crate::hub::Snapshot;
use crate::motor::{Report, Setpoint};
use entry::{HEAD, TICK, checksum};
use live::{LIVE, Live, Now, WORDS};

/// Bytes that a record takes.
pub const SIZE: usize = 4096;

/// Heads that are kept.
pub const HEADS: usize = 8;

/// Entries, the newest, whose ticks are kept.
pub const PAGES: usize = 3;

/// Ticks that are kept of a motor.
pub const TICKS: usize = 64;

/// Motors whose ticks are kept: the first four.
pub const MOTORS: usize = 4;

/// The ring has a slot more than there are ticks: what a reset cut short is in none of them.
const SLOTS: usize = TICKS + 1;
const SLOT: usize = MOTORS * TICK;
const PAGE: usize = TICKS * TICK;
const _: () = assert!(LIVE + WORDS + SLOTS * SLOT + HEADS * HEAD + PAGES * PAGE <= SIZE);

/// The record, in memory that is lent to it.
#[derive(Debug)]
pub struct Record<'a> {
    live: Live<'a>,
    now: Now,
    ring: &'a mut [[u8; SLOT]],
    heads: &'a mut [[u8; HEAD]],
    pages: &'a mut [[u8; PAGE]],
    run: u32,
    /// Of the newest entry; 0 before the first.
    number: u16,
    /// Faults of each motor at the last tick, as bits.
    known: [u8; MOTORS],
}

/// What an entry says of one motor.
#[derive(Clone, Copy)]
struct Concerned {
    motor: usize,
    drive: Drive,
}

impl<'a> Record<'a> {
    /// After a reset of this cause. What ended the run before, if memory holds one, becomes an entry: its last words, or
    /// else the cause.
    #[inline(never)]
    pub fn open(memory: &'a mut [u8; SIZE], cause: Fault) -> (Self, LastWords<'a>) {
        let (live, rest) = memory.split_at_mut(LIVE);
        let (words, rest) = rest.split_at_mut(WORDS);
        let (ring, rest) = rest.split_at_mut(SLOTS * SLOT);
        let (heads, pages) = rest.split_at_mut(HEADS * HEAD);
        let mut record = Self {
            live: Live(live.as_chunks_mut().0),
            now: Now::default(),
            ring: ring.as_chunks_mut().0,
            heads: heads.as_chunks_mut().0,
            pages: pages.as_chunks_mut().0,
            run: 0,
            number: 0,
            known: [0; MOTORS],
        };
        let mut last_words = LastWords(words.as_chunks_mut().0);
        let said = last_words.take();
        match record.live.left() {
            Some(left) => {
                (record.run, record.now) = (left.run, left.now);
                record.number = record.newest().map_or(0, |(head, _)| head.number);
                let (fault, detail) = said.unwrap_or((cause, [0; 2]));
                record.write(fault, detail, record.busiest());
            }
            None => record.clear(),
        }
        record.run = record.run.wrapping_add(1);
        record.now = Now::default();
        record.live.begin(record.run);
        (record, last_words)
    }

    /// Forgets all entries. The present run goes on.
    pub fn clear(&mut self) {
        self.heads.as_flattened_mut().fill(0);
        self.number = 0;
    }

    /// A control tick: every one, whatever the period.
    pub fn tick<const N: usize>(&mut self, snapshot: &Snapshot<N>) {
        let slot = self.ring.get_mut(usize::from(self.now.next)).map(|slot| slot.as_chunks_mut().0);
        for (place, report) in slot.into_iter().flatten().zip(&snapshot.motors) {
            *place = Tick::of(report).to_bytes();
        }
        self.now = Now {
            time: (snapshot.at.get() >> 10) as u32,
            battery: snapshot.battery,
            next: if usize::from(self.now.next) + 1 < SLOTS { self.now.next + 1 } else { 0 },
            filled: if usize::from(self.now.filled) < TICKS { self.now.filled + 1 } else { self.now.filled },
        };
        self.live.tell(self.now);
        for (motor, report) in snapshot.motors.iter().enumerate() {
            let Some(known) = self.known.get_mut(motor) else { break };
            let present = bits(report);
            let new = present & !*known;
            *known = present;
            if new != 0 {
                self.note(motor, new);
            }
        }
    }

    /// Which run this is since the record began, from 1.
    pub const fn run(&self) -> u32 {
        self.run
    }

    /// The entries, newest first.
    pub fn heads(&self) -> impl Iterator<Item = Head> {
        (0..HEADS as u16).map_while(|age| {
            // An entry that is not whole ends the list: what is older may be of any age.
            let (head, sum) = self.head(self.number.wrapping_sub(age))?;
            let ticks = if self.page(&head, sum).is_some() { head.ticks } else { 0 };
            Some(Head { ticks, ..head })
        })
    }

    /// The ticks of an entry, oldest first; `None` if there is no such entry, or no more ticks of it.
    pub fn ticks(&self, number: u16) -> Option<impl ExactSizeIterator<Item = Tick>> {
        let (head, sum) = self.head(number)?;
        Some(self.page(&head, sum)?.iter().map(|bytes| Tick::from_bytes(*bytes)))
    }

    /// New faults of a motor.
    #[cold]
    fn note(&mut self, motor: usize, new: u8) {
        // At this tick the bridge is open already.
        let drive = self.tick_before(motor).map_or(Drive::COAST, |tick| tick.drive);
        for fault in Fault::in_bits(new) {
            self.write(fault, [0; 2], Some(Concerned { motor, drive }));
        }
    }

    /// An entry; or one more of the same.
    fn write(&mut self, fault: Fault, detail: [u32; 2], concerned: Option<Concerned>) {
        let motor = concerned.map(|concerned| concerned.motor as u8);
        if let Some((head, sum)) = self.newest().filter(|(head, _)| {
            // All motors are on one battery.
            let whose = head.motor == motor || fault == Fault::BatteryUnknown;
            // Runs that end in the same way before they have begun must not push out what came before them.
            let stillborn = self.now.filled == 0 && head.ticks == 0;
            let same = head.fault == fault && head.detail == detail && whose;
            same && (head.run == self.run as u16 || stillborn)
        }) {
            return self.put(Head { times: head.times.saturating_add(1), ..head }, sum);
        }
        // 0 is before the first.
        self.number = self.number.checked_add(1).unwrap_or(1);
        let (ticks, sum) = concerned.map_or((0, 0), |concerned| self.copy(concerned.motor));
        let Now { time, battery, .. } = self.now;
        let head = Head {
            number: self.number,
            fault,
            times: 1,
            run: self.run as u16,
            uptime_ms: (u64::from(time) * 128 / 125) as u32,
            battery,
            motor,
            drive: concerned.map_or(Drive::COAST, |concerned| concerned.drive),
            detail,
            ticks,
        };
        self.put(head, sum);
    }

    fn put(&mut self, head: Head, sum: u32) {
        if let Some(place) = self.heads.get_mut(usize::from(head.number) % HEADS) {
            *place = head.to_bytes(sum);
        }
    }

    /// A motor's ring to the page of the newest entry: how many ticks, and their checksum.
    fn copy(&mut self, motor: usize) -> (u8, u32) {
        let Now { next, filled, .. } = self.now;
        let Some(page) = self.pages.get_mut(usize::from(self.number) % PAGES) else { return (0, 0) };
        let first = (usize::from(next) + SLOTS - usize::from(filled)) % SLOTS;
        let slots = self.ring.iter().cycle().skip(first).take(filled.into());
        let ticks = slots.filter_map(|slot| slot.as_chunks::<TICK>().0.get(motor));
        let mut count = 0;
        for (place, tick) in page.as_chunks_mut().0.iter_mut().zip(ticks) {
            *place = *tick;
            count += 1;
        }
        let sum = page.get(..usize::from(count) * TICK).map_or(0, checksum);
        (count, sum)
    }

    /// The entry with this number, and the checksum of its ticks.
    fn head(&self, number: u16) -> Option<(Head, u32)> {
        let (head, sum) = Head::from_bytes(self.heads.get(usize::from(number) % HEADS)?)?;
        (head.number == number).then_some((head, sum))
    }

    /// While a run begins the number is not known yet.
    fn newest(&self) -> Option<(Head, u32)> {
        if self.number != 0 {
            return self.head(self.number);
        }
        let heads = self.heads.iter().filter_map(Head::from_bytes);
        heads.reduce(|one, other| if is_after(other.0.number, one.0.number) { other } else { one })
    }

    fn page(&self, head: &Head, sum: u32) -> Option<&[[u8; TICK]]> {
        let page = self.pages.get(usize::from(head.number) % PAGES)?;
        let ticks = page.get(..usize::from(head.ticks) * TICK).filter(|ticks| !ticks.is_empty())?;
        (checksum(ticks) == sum).then_some(ticks.as_chunks().0)
    }

    /// So many ticks ago, from 1.
    fn tick_ago(&self, motor: usize, ago: usize) -> Option<Tick> {
        let slot = (usize::from(self.now.next) + SLOTS - ago) % SLOTS;
        let bytes = self.ring.get(slot).filter(|_| ago <= usize::from(self.now.filled))?;
        bytes.as_chunks().0.get(motor).map(|bytes| Tick::from_bytes(*bytes))
    }

    fn tick_before(&self, motor: usize) -> Option<Tick> {
        self.tick_ago(motor, 2)
    }

    /// The motor that was driven most at the last tick; `None` if all coasted.
    fn busiest(&self) -> Option<Concerned> {
        let drives = (0..MOTORS).filter_map(|motor| Some((motor, self.tick_ago(motor, 1)?.drive)));
        let driven = drives.filter(|(_, drive)| *drive != Drive::COAST);
        let most = driven.max_by_key(|(_, drive)| (drive.mode != Mode::Brake50, drive.duty.to_bits()));
        most.map(|(motor, drive)| Concerned { motor, drive })
    }
}

/// Numbers wrap.
const fn is_after(one: u16, other: u16) -> bool {
    one.wrapping_sub(other) as i16 > 0
}

/// Faults of a motor that is to do something; of one that is not they keep it from nothing.
fn bits(report: &Report) -> u8 {
    match report.setpoint {
        Setpoint::Disabled | Setpoint::FailSafe => 0,
        _ => Fault::bits_of(report.faults),
    }
}
