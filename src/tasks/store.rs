//! Stores settings in flash. The task reads the settings once at boot, and then carries out the requests of the
//! responder.
//!
//! Two pages of flash hold a *map* of [`sequential_storage`], which stores an *item* for each of three keys. Two items
//! are copies of one [`SettingsRecord`]. The third item is a mark without content, which tells that a save was
//! completed since the memory was erased. The map appends items to one page until the page is full. The map then
//! *moves*: it copies the newest items to the other page, and erases the full page.
//!
//! Other tasks run after each word that is written. Pages are only erased at boot, and for a request that the responder
//! has made while all motors were off. A motor that a host enables after the request does not prevent the erasure.
//!
//! ```
//! use embassy_futures::block_on;
//! use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
//! use motor_hub::store::{StoreRequest, Outcome, SettingsRecord, Stored};
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
//! let request = StoreRequest { record: Some(SettingsRecord::new(1)), erase_first: false, may_erase: true };
//! let done = block_on(keeper.carry_out(&request));
//! assert_eq!((done.outcome, done.found.map(|found| found.stored)), (Outcome::Done, Some(Stored::Whole)));
//! ```

use super::{WORD_BYTES, Wires};
use crate::store::{CAPACITY, Found, Outcome, SettingsRecord, StoreRequest, StoreResult, Stored};
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

/// Keys of the two copies in the map.
const COPY_KEYS: [u8; 2] = [1, 2];

/// Key of the mark that a save was completed. If neither copy can be read, the copies are damaged if there is a mark.
/// Without a mark a power failure has interrupted the first save.
const SAVED_KEY: u8 = 3;

/// Size of a buffer for a record with its key, in bytes, rounded up to a multiple of the longest word.
const BUFFER_BYTES: usize = (1 + CAPACITY).next_multiple_of(WORD_BYTES);

/// Runs the task: reads the settings once, and then carries out requests. Never returns.
pub async fn run<M: RawMutex, const N: usize>(mut keeper: Keeper<impl NorFlash>, wires: &Wires<M, N>) -> ! {
    let found = Some(keeper.read().await);
    wires.store.done.signal(StoreResult { found, outcome: Outcome::None });
    loop {
        let request = wires.store.request.wait().await;
        wires.store.done.signal(keeper.carry_out(&request).await);
    }
}

/// The flash in which settings are stored.
pub struct Keeper<F: NorFlash> {
    flash: SharedFlash<F>,
    /// Addresses of the two pages.
    range: Range<u32>,
    /// True if the last repair of the pages has succeeded, and the last request after the repair too.
    intact: bool,
    /// Memory for one item of the map.
    buffer: [u8; BUFFER_BYTES],
}

/// The map. Its cache holds the addresses of the three items. Without the cache a move would search the whole page for
/// each item.
type Map<'a, F> =
    MapStorage<u8, &'a mut SharedFlash<F>, Cache<Uncached, Uncached, ArrayKeyPointers<u8, 3>, u8>>;

impl<F: NorFlash> Keeper<F> {
    /// Creates the store in a range of a flash. `None` unless the range is two whole pages.
    pub fn new(flash: F, range: Range<u32>) -> Option<Self> {
        MapConfig::<F>::try_new(range.clone()).ok().filter(|_| range.len() == 2 * F::ERASE_SIZE)?;
        let flash = SharedFlash { flash, may_erase: true, visible: None };
        Some(Self { flash, range, intact: false, buffer: [0; BUFFER_BYTES] })
    }

    /// Returns the map with an empty cache, and a buffer for the map.
    fn map(&mut self) -> (Map<'_, F>, &mut [u8]) {
        let cache = Cache::new(Uncached, Uncached, ArrayKeyPointers::new());
        (MapStorage::new(&mut self.flash, MapConfig::new(self.range.clone()), cache), &mut self.buffer)
    }

    /// Reads the stored settings. All motors must be off, because an erasure that a power failure has interrupted is
    /// repeated first. If this repair fails, the settings count as damaged.
    pub async fn read(&mut self) -> Found {
        self.flash.may_erase = true;
        let repaired = self.repair().await;
        self.intact = repaired.is_ok();
        let damaged = || Found::without_record(Stored::Damaged, 0);
        match self.copies().await {
            Ok(_) if !self.intact => damaged(),
            copies => found(copies).unwrap_or_else(damaged),
        }
    }

    /// Erases each page whose erasure a power failure has interrupted.
    ///
    /// The map cannot recognise a page that is erased in part. The map would treat the page as blank, or as one of the
    /// two pages of an interrupted move.
    async fn repair(&mut self) -> Result<(), FlashError> {
        // For each page in use, true if the page is full; `None` for a page that is blank or has been erased here.
        let mut in_use = [None; 2];
        let pages = self.pages();
        for (in_use, page) in in_use.iter_mut().zip(&pages) {
            let flash = &mut self.flash;
            let begun = flash.is_marked(page.start).await?;
            let full = flash.is_marked(page.end - F::READ_SIZE as u32).await?;
            if begun {
                *in_use = Some(full);
            } else if full || !flash.is_blank(page).await? {
                flash.erase(page.start, page.end).await?;
            }
        }
        // If both pages are in use, a move or an erasure was interrupted. The page with the older save is erased. If
        // both have the same save, the page with fewer copies is erased. If these numbers are equal too, the full page
        // is erased. If one page cannot be read, or has a later version, both pages stay.
        let ([first, second], [Some(first_full), Some(second_full)]) = (&pages, in_use) else {
            return Ok(());
        };
        let contents = (self.content(first).await, self.content(second).await);
        let (Some(first_content), Some(second_content)) = contents else { return Ok(()) };
        let second_has_less = (second_content, !second_full) < (first_content, !first_full);
        let less = if second_has_less { second } else { first };
        self.flash.erase(less.start, less.end).await
    }

    /// Returns the addresses of the two pages.
    fn pages(&self) -> [Range<u32>; 2] {
        let Range { start, end } = self.range;
        let middle = start + F::ERASE_SIZE as u32;
        [start..middle, middle..end]
    }

    /// Reads the content of one page, while the other page is hidden. `None` if the content cannot be read, or has a
    /// later version.
    async fn content(&mut self, page: &Range<u32>) -> Option<PageContent> {
        self.flash.visible = Some(page.clone());
        let copies = self.copies().await;
        self.flash.visible = None;
        let Found { stored, record, .. } = match copies {
            // After an interrupted erasure the remaining bytes may look like an item of any length.
            Err(Error::BufferTooSmall(_)) => return Some(PageContent { save: 0, copies: 0 }),
            copies => copies.ok()?,
        };
        let copies = match stored {
            Stored::Whole => 2,
            Stored::OneCopy => 1,
            Stored::Nothing | Stored::Damaged => 0,
            Stored::Later => return None,
        };
        Some(PageContent { save: record.number(), copies })
    }

    /// Carries out a request: writes a record if the request has one, and then reads what is stored. The pages are
    /// repaired first if the last request has failed. The outcome is [`Outcome::NeedsErase`] if a page must be erased
    /// first, and [`Outcome::Lost`] if the memory does not return what was written.
    pub async fn carry_out(&mut self, request: &StoreRequest) -> StoreResult {
        self.flash.may_erase = request.may_erase;
        let repaired = if self.intact { Ok(()) } else { self.repair().await };
        let written = match repaired {
            Ok(()) => self.write(request).await,
            Err(error) => error.outcome(),
        };
        let found = found(self.copies().await);
        let reads_back = |found: &Found| {
            let is_stored =
                |record: &SettingsRecord| found.stored == Stored::Whole && *record == found.record;
            request.record.as_ref().is_none_or(is_stored)
        };
        let outcome = match written {
            Outcome::Done if found.is_none() => Outcome::NeedsErase,
            Outcome::Done if !found.as_ref().is_some_and(reads_back) => Outcome::Lost,
            outcome => outcome,
        };
        self.intact = outcome == Outcome::Done;
        StoreResult { found, outcome }
    }

    /// Writes both copies of the request's record, and then the mark if it is missing. Writes nothing if the request
    /// has no record.
    async fn write(&mut self, request: &StoreRequest) -> Outcome {
        let Some(record) = &request.record else { return Outcome::Done };
        let (mut map, buffer) = self.map();
        if request.erase_first
            && let Err(error) = map.erase_all().await
        {
            return outcome(&error);
        }
        for copy in COPY_KEYS {
            if let Err(error) = map.store_item(buffer, &copy, &record.bytes()).await {
                return outcome(&error);
            }
        }
        let saved = match map.fetch_item::<&[u8]>(buffer, &SAVED_KEY).await {
            Ok(None) => map.store_item(buffer, &SAVED_KEY, &[].as_slice()).await,
            saved => saved.map(|_| ()),
        };
        saved.map_or_else(|error| outcome(&error), |()| Outcome::Done)
    }

    /// Reads both copies. If neither can be read, but a save was completed, the state is [`Stored::Damaged`].
    async fn copies(&mut self) -> Result<Found, Error<FlashError>> {
        let (mut map, buffer) = self.map();
        let mut found = Found::default();
        for copy in COPY_KEYS {
            found.add(map.fetch_item::<&[u8]>(buffer, &copy).await?);
        }
        if found.stored == Stored::Nothing && map.fetch_item::<&[u8]>(buffer, &SAVED_KEY).await?.is_some() {
            found.stored = Stored::Damaged;
        }
        Ok(found)
    }
}

/// Content of one page. Contents are ordered by their saves. Contents with the same save are ordered by their copies.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct PageContent {
    /// Number of the newest save in the page.
    save: u32,
    /// Number of copies of this save in the page, 0 to 2.
    copies: u8,
}

/// Converts the result of reading the copies to contents of the memory. `None` if the map must erase a page first, and
/// motors are not off.
fn found(copies: Result<Found, Error<FlashError>>) -> Option<Found> {
    match copies {
        Ok(found) => Some(found),
        Err(Error::Storage { value: FlashError::MayNotErase, .. }) => None,
        // An item that is longer than the buffer was not written by this firmware.
        Err(Error::BufferTooSmall(_)) => Some(Found::without_record(Stored::Later, 0)),
        Err(_) => Some(Found::without_record(Stored::Damaged, 0)),
    }
}

/// Converts an error of the map to the outcome of a request.
const fn outcome(error: &Error<FlashError>) -> Outcome {
    match error {
        Error::Storage { value, .. } => value.outcome(),
        _ => Outcome::Refused,
    }
}

/// A flash that lets other tasks run after each word. It refuses to erase pages while motors run or while a page is
/// hidden.
struct SharedFlash<F> {
    flash: F,
    /// True if motors are off, so that pages may be erased.
    may_erase: bool,
    /// Range of addresses that can be read. All other addresses are hidden: they read as blank. `None` if the whole
    /// flash can be read.
    visible: Option<Range<u32>>,
}

/// Number of zero bits of a word from which the map treats the word as marked: half of the bits of a byte. The map
/// marks the first word of a page in use, and the last word of a full page, with bytes of zeros.
const MARK_BITS: u32 = 4;

impl<F: NorFlash> SharedFlash<F> {
    /// True if the word at this address is marked.
    async fn is_marked(&mut self, address: u32) -> Result<bool, FlashError> {
        let mut word = [0xFF; WORD_BYTES];
        self.read(address, word.get_mut(..F::READ_SIZE).unwrap_or_default()).await?;
        Ok(word.iter().map(|byte| byte.count_zeros()).sum::<u32>() >= MARK_BITS)
    }

    /// True if all bytes of a page are 0xFF.
    async fn is_blank(&mut self, page: &Range<u32>) -> Result<bool, FlashError> {
        let mut word = [0; WORD_BYTES];
        for at in page.clone().step_by(WORD_BYTES) {
            self.read(at, &mut word).await?;
            if word != [0xFF; WORD_BYTES] {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Why the flash refused an operation.
#[derive(Debug)]
enum FlashError {
    /// No page may be erased, because motors run or a page is hidden.
    MayNotErase,
    /// The flash reports an error of this kind.
    Flash(NorFlashErrorKind),
}

impl FlashError {
    fn of(error: impl NorFlashError) -> Self {
        Self::Flash(error.kind())
    }

    /// Converts the error to the outcome of a request.
    const fn outcome(&self) -> Outcome {
        match self {
            Self::MayNotErase => Outcome::NeedsErase,
            Self::Flash(_) => Outcome::Refused,
        }
    }
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::MayNotErase => NorFlashErrorKind::Other,
            Self::Flash(kind) => *kind,
        }
    }
}

impl<F: NorFlash> ErrorType for SharedFlash<F> {
    type Error = FlashError;
}

impl<F: NorFlash> ReadNorFlash for SharedFlash<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        // The map computes a checksum after each read, without letting other tasks run. So other tasks run before the
        // read.
        yield_now().await;
        if self.visible.as_ref().is_some_and(|visible| !visible.contains(&offset)) {
            bytes.fill(0xFF);
            return Ok(());
        }
        self.flash.read(offset, bytes).await.map_err(FlashError::of)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl<F: NorFlash> NorFlash for SharedFlash<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        if !self.may_erase || self.visible.is_some() {
            return Err(FlashError::MayNotErase);
        }
        self.flash.erase(from, to).await.map_err(FlashError::of)
    }

    async fn write(&mut self, mut offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        for word in bytes.chunks(F::WRITE_SIZE) {
            self.flash.write(offset, word).await.map_err(FlashError::of)?;
            offset += F::WRITE_SIZE as u32;
            yield_now().await;
        }
        Ok(())
    }
}
