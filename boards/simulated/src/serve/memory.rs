//! A file instead of flash, for settings that are kept between runs of the program. It has two pages of 16 KB, as the
//! NUCLEO-F429ZI has.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use motor_hub::tasks::store::Keeper;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;

/// Size of a page in bytes.
const PAGE: u32 = 16 * 1024;
/// Size of the store in bytes.
const SIZE: u32 = 2 * PAGE;
/// Number of erased bytes at the beginning of a page whose erasure was interrupted: at least a sector of a disk.
const SECTOR: usize = 512;

/// Error of opening a file as the store of settings.
#[derive(Debug, thiserror::Error)]
pub enum MemoryError {
    /// The file cannot be opened, read or written.
    #[error("{path}: {error}")]
    File {
        /// The file.
        path: String,
        /// Error of the operating system.
        error: io::Error,
    },
    /// Another served hub uses the file.
    #[error(
        "{path} is the store of another served hub, which still runs; give another file, or end that hub"
    )]
    InUse {
        /// The file.
        path: String,
    },
    /// The file is not a store of settings.
    #[error(
        "{path} with {size} bytes is not a store of a hub's settings; a store has {SIZE} bytes, written by a hub; give another file"
    )]
    NotAStore {
        /// The file.
        path: String,
        /// Size of the file in bytes.
        size: u64,
    },
}

/// The store of a served hub's settings.
#[derive(Debug)]
pub struct Memory(File);

impl Memory {
    /// Opens or creates a file, and locks it: no other hub can use the file while this hub runs.
    ///
    /// If the file is too short and has only erased bytes, erased bytes are appended up to the full size. Creating a
    /// file on a full disk leaves such a file. In a file of the full size each page must begin as a hub writes it. A file
    /// that is not a store is not changed.
    ///
    /// # Errors
    /// If the file cannot be read and written, is in use by another hub, or is not a store.
    pub fn open(path: &Path) -> Result<Self, MemoryError> {
        let shown = || path.display().to_string();
        let at = |error| MemoryError::File { path: shown(), error };
        let mut file =
            OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path).map_err(at)?;
        match file.try_lock() {
            Ok(()) => (),
            Err(TryLockError::WouldBlock) => return Err(MemoryError::InUse { path: shown() }),
            Err(TryLockError::Error(error)) => return Err(at(error)),
        }
        let mut bytes = Vec::new();
        // One byte more than a store has is enough to find that the file is too long.
        (&file).take(u64::from(SIZE) + 1).read_to_end(&mut bytes).map_err(at)?;
        let rest = (SIZE as usize).checked_sub(bytes.len()).filter(|rest| match rest {
            0 => bytes.chunks(PAGE as usize).all(may_be_a_page),
            _ => is_erased(&bytes),
        });
        let Some(rest) = rest else {
            let size = file.metadata().map_err(at)?.len();
            return Err(MemoryError::NotAStore { path: shown(), size });
        };
        file.write_all(&vec![0xFF; rest]).map_err(at)?;
        Ok(Self(file))
    }

    pub(super) fn keeper(self) -> Option<Keeper<Self>> {
        Keeper::new(self, 0..SIZE)
    }

    fn at<T>(
        &mut self,
        offset: u32,
        act: impl FnOnce(&mut File) -> io::Result<T>,
    ) -> Result<T, NorFlashErrorKind> {
        let moved = self.0.seek(SeekFrom::Start(offset.into()));
        moved.and_then(|_| act(&mut self.0)).map_err(|_| NorFlashErrorKind::Other)
    }
}

fn is_erased(bytes: &[u8]) -> bool {
    bytes.iter().all(|byte| *byte == 0xFF)
}

/// True if a page begins as a hub writes it: with a mark of zeros and the checksum of an item, which is never 0, or with
/// erased bytes. The program may have been killed while it erased or wrote the page.
fn may_be_a_page(page: &[u8]) -> bool {
    let is_marked = page.starts_with(&[0; 4]) && !page.starts_with(&[0; 8]);
    is_marked || page.get(..SECTOR).is_some_and(is_erased)
}

impl ErrorType for Memory {
    /// The operating system has refused to read or to write.
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Memory {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        self.at(offset, |file| file.read_exact(bytes))
    }

    fn capacity(&self) -> usize {
        SIZE as usize
    }
}

impl NorFlash for Memory {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = PAGE as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        self.at(from, |file| file.write_all(&vec![0xFF; to.saturating_sub(from) as usize]))
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        self.at(offset, |file| file.write_all(bytes))
    }
}
