//! Where settings are stored: a map in flash of which two keys are the two copies of one record. It reads once at boot,
//! and then does what the responder orders.
//!
//! The map is [`sequential_storage`]'s: it appends until a page is full, and moves to the next. Everything is done a word at a
//! time, with all other tasks between two words, and an erasure only while motors are off.
//!
//! ```
//! use embassy_futures::block_on;
//! use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
//! use motor_hub::store::{Order, Outcome, Record, Stored};
//! use motor_hub::tasks::store::Keeper;
//!
//! /// Two pages in memory.
//! struct Pages(Vec<u8>);
//!
//! impl ErrorType for Pages {
//!     type Error = core::convert::Infallible;
//! }
//!
//! impl ReadNorFlash for Pages {
//!     const READ_SIZE: usize = 1;
//!
//!     async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
//!         bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
//!         Ok(())
//!     }
//!
//!     fn capacity(&self) -> usize {
//!         self.0.len()
//!     }
//! }
//!
//! impl NorFlash for Pages {
//!     const WRITE_SIZE: usize = 4;
//!     const ERASE_SIZE: usize = 16 * 1024;
//!
//!     async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
//!         self.0[from as usize..to as usize].fill(0xFF);
//!         Ok(())
//!     }
//!
//!     async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
//!         self.0[offset as usize..][..bytes.len()].copy_from_slice(bytes);
//!         Ok(())
//!     }
//! }
//!
//! let mut keeper = Keeper::new(Pages(vec![0xFF; 32 * 1024]), 0..32 * 1024).expect("two pages");
//! assert_eq!(block_on(keeper.read()).stored, Stored::Nothing);
//! let order = Order { record: Some(Record::new(1)), afresh: false, may_erase: true };
//! let done = block_on(keeper.carry_out(&order));
//! assert_eq!((done.outcome, done.found.map(|found| found.stored)), (Outcome::Done, Some(Stored::Whole)));
//! ```

use super::Wires;
use crate::store::{CAPACITY, Copies, Found, Order, Outcome, Stored};
use core::ops::Range;
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use sequential_storage::Error;
use sequential_storage::cache::key_pointers::ArrayKeyPointers;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage};

/// The keys of the two copies.
const COPIES: [u8; 2] = [1, 2];

/// A record with its key, in whole words of any flash.
const BUFFER: usize = (1 + CAPACITY).next_multiple_of(32);

/// The longest word of any flash.
const WORD: usize = 32;

/// What has become of an order; once, at boot, what was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Done {
    /// What is stored now; `None` if that cannot be told until motors are off, and is as it was.
    pub found: Option<Found>,
    /// How it ended.
    pub outcome: Outcome,
}

/// Reads once, and then does what is ordered, for ever.
pub async fn run<M: RawMutex, const N: usize>(mut keeper: Keeper<impl NorFlash>, wires: &Wires<M, N>) -> ! {
    let found = Some(keeper.read().await);
    wires.store.done.signal(Done { found, outcome: Outcome::None });
    loop {
        let order = wires.store.order.wait().await;
        wires.store.done.signal(keeper.carry_out(&order).await);
    }
}

/// The memory, and what is kept there.
pub struct Keeper<F: NorFlash> {
    flash: Paced<F>,
    range: Range<u32>,
    /// Nothing has gone wrong since the pages were last looked at.
    sound: bool,
    buffer: [u8; BUFFER],
}

/// It remembers where the copies are, or moving a full page would search all of it for each of its items.
type Map<'a, F> = MapStorage<u8, &'a mut Paced<F>, Cache<Uncached, Uncached, ArrayKeyPointers<u8, 2>, u8>>;

impl<F: NorFlash> Keeper<F> {
    /// In this range of a flash; `None` unless it is two whole pages.
    pub fn new(flash: F, range: Range<u32>) -> Option<Self> {
        MapConfig::<F>::try_new(range.clone()).ok().filter(|_| range.len() == 2 * F::ERASE_SIZE)?;
        let flash = Paced { flash, may_erase: true, shown: None };
        Some(Self { flash, range, sound: false, buffer: [0; BUFFER] })
    }

    /// The map, of whose pages nothing is known yet, and a buffer for it.
    fn map(&mut self) -> (Map<'_, F>, &mut [u8]) {
        let cache = Cache::new(Uncached, Uncached, ArrayKeyPointers::new());
        (MapStorage::new(&mut self.flash, MapConfig::new(self.range.clone()), cache), &mut self.buffer)
    }

    /// What is stored. Motors must be off: power may have gone in the middle of an erasure, which is then done again.
    pub async fn read(&mut self) -> Found {
        self.flash.may_erase = true;
        let mended = self.mend().await;
        self.sound = mended.is_ok();
        let copies =
            self.copies().await.and_then(|found| mended.map(|()| found).map_err(|_| NotRead::Damaged));
        copies.unwrap_or_else(|why| why.found().unwrap_or_else(|| Found::without_record(Stored::Damaged, 0)))
    }

    /// Erases pages of which power has cut the erasure, and that the map would take for what they are not: for blank ones,
    /// or for the ones that it is just moving its items from, or to.
    async fn mend(&mut self) -> Result<(), Trouble<F::Error>> {
        let mut full = [None; 2];
        let pages = self.pages();
        for (full, page) in full.iter_mut().zip(&pages) {
            let flash = &mut self.flash;
            *full = match flash.marks(page).await? {
                (true, full) => Some(full),
                (false, false) if flash.is_blank(page).await? => None,
                (false, _) => {
                    flash.erase(page.start, page.end).await?;
                    None
                }
            };
        }
        // Of two that both hold something, one is on its way to be erased: the one with less, or the one that was full before.
        let ([first, second], [Some(first_full), Some(second_full)]) = (&pages, full) else { return Ok(()) };
        let worth = (self.worth(first).await, self.worth(second).await);
        let (Some(first_worth), Some(second_worth)) = worth else { return Ok(()) };
        let second_has_less = (second_worth, first_full) < (first_worth, second_full);
        let less = if second_has_less { second } else { first };
        self.flash.erase(less.start, less.end).await
    }

    fn pages(&self) -> [Range<u32>; 2] {
        let Range { start, end } = self.range;
        let middle = start + F::ERASE_SIZE as u32;
        [start..middle, middle..end]
    }

    /// What a page has by itself: number of the save, and copies of it; `None` where that is not known.
    async fn worth(&mut self, page: &Range<u32>) -> Option<(u32, u8)> {
        self.flash.shown = Some(page.clone());
        let found = self.copies().await;
        self.flash.shown = None;
        let Found { stored, record, .. } = match found {
            // What an erasure has left may look like anything.
            Err(NotRead::TooLong) => return Some((0, 0)),
            found => found.ok()?,
        };
        let copies = match stored {
            Stored::Whole => 2,
            Stored::OneCopy => 1,
            Stored::Nothing | Stored::Damaged => 0,
            Stored::Later => return None,
        };
        Some((record.number(), copies))
    }

    /// Writes, if that is ordered, and reads what is stored then.
    pub async fn carry_out(&mut self, order: &Order) -> Done {
        self.flash.may_erase = order.may_erase;
        let mended = if self.sound { Ok(()) } else { self.mend().await };
        let written = match mended {
            Ok(()) => self.write(order).await,
            Err(trouble) => trouble.outcome(),
        };
        let found = self.copies().await.map_or_else(NotRead::found, Some);
        let reads_back = |found: &Found| {
            order.record.as_ref().is_none_or(|it| found.stored == Stored::Whole && *it == found.record)
        };
        let outcome = match written {
            Outcome::Done if found.is_none() => Outcome::NeedsErase,
            Outcome::Done if !found.as_ref().is_some_and(reads_back) => Outcome::Lost,
            outcome => outcome,
        };
        self.sound = outcome == Outcome::Done;
        Done { found, outcome }
    }

    async fn write(&mut self, order: &Order) -> Outcome {
        let Some(record) = &order.record else { return Outcome::Done };
        let (mut map, buffer) = self.map();
        if order.afresh
            && let Err(error) = map.erase_all().await
        {
            return outcome(&error);
        }
        for copy in COPIES {
            if let Err(error) = map.store_item(buffer, &copy, &record.bytes()).await {
                return outcome(&error);
            }
        }
        Outcome::Done
    }

    async fn copies(&mut self) -> Result<Found, NotRead> {
        let (mut map, buffer) = self.map();
        let mut copies = Copies::default();
        for copy in COPIES {
            match map.fetch_item::<&[u8]>(buffer, &copy).await {
                Ok(bytes) => copies.add(bytes),
                Err(Error::BufferTooSmall(_)) => return Err(NotRead::TooLong),
                Err(Error::Storage { value: Trouble::MotorsRun, .. }) => return Err(NotRead::NeedsErase),
                Err(_) => return Err(NotRead::Damaged),
            }
        }
        Ok(copies.found())
    }
}

enum NotRead {
    NeedsErase,
    /// An item is longer than any that this firmware writes.
    TooLong,
    Damaged,
}

impl NotRead {
    /// What that says of what is stored; nothing if it says nothing.
    fn found(self) -> Option<Found> {
        match self {
            Self::NeedsErase => None,
            Self::TooLong => Some(Found::without_record(Stored::Later, 0)),
            Self::Damaged => Some(Found::without_record(Stored::Damaged, 0)),
        }
    }
}

const fn outcome<E>(error: &Error<Trouble<E>>) -> Outcome {
    match error {
        Error::Storage { value, .. } => value.outcome(),
        _ => Outcome::Refused,
    }
}

/// A flash that lets other tasks run between two words, and is not erased while motors run.
struct Paced<F> {
    flash: F,
    may_erase: bool,
    /// All else reads as if it were blank.
    shown: Option<Range<u32>>,
}

/// A page's mark counts once so many bits are written, as the map has it.
const MARKED: u32 = 4;

impl<F: NorFlash> Paced<F> {
    /// Whether a page is marked as begun, and as full.
    async fn marks(&mut self, page: &Range<u32>) -> Result<(bool, bool), Trouble<F::Error>> {
        let mut marks = [false; 2];
        for (mark, at) in marks.iter_mut().zip([page.start, page.end - F::READ_SIZE as u32]) {
            let mut word = [0xFF; WORD];
            self.read(at, word.get_mut(..F::READ_SIZE).unwrap_or_default()).await?;
            *mark = word.iter().map(|byte| byte.count_zeros()).sum::<u32>() >= MARKED;
        }
        Ok(marks.into())
    }

    async fn is_blank(&mut self, page: &Range<u32>) -> Result<bool, Trouble<F::Error>> {
        let mut word = [0; WORD];
        for at in page.clone().step_by(WORD) {
            self.read(at, &mut word).await?;
            if word != [0xFF; WORD] {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

#[derive(Debug)]
enum Trouble<E> {
    MotorsRun,
    Flash(E),
}

impl<E> Trouble<E> {
    const fn outcome(&self) -> Outcome {
        match self {
            Self::MotorsRun => Outcome::NeedsErase,
            Self::Flash(_) => Outcome::Refused,
        }
    }
}

impl<E: NorFlashError> NorFlashError for Trouble<E> {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::MotorsRun => NorFlashErrorKind::Other,
            Self::Flash(error) => error.kind(),
        }
    }
}

impl<F: NorFlash> ErrorType for Paced<F> {
    type Error = Trouble<F::Error>;
}

impl<F: NorFlash> ReadNorFlash for Paced<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        // Who reads computes a checksum of it next.
        yield_now().await;
        if self.shown.as_ref().is_some_and(|shown| !shown.contains(&offset)) {
            bytes.fill(0xFF);
            return Ok(());
        }
        self.flash.read(offset, bytes).await.map_err(Trouble::Flash)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl<F: NorFlash> NorFlash for Paced<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        if !self.may_erase || self.shown.is_some() {
            return Err(Trouble::MotorsRun);
        }
        self.flash.erase(from, to).await.map_err(Trouble::Flash)
    }

    async fn write(&mut self, mut offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        for word in bytes.chunks(F::WRITE_SIZE) {
            self.flash.write(offset, word).await.map_err(Trouble::Flash)?;
            offset += F::WRITE_SIZE as u32;
            yield_now().await;
        }
        Ok(())
    }
}
