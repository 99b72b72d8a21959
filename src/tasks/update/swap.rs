//! Ties a swap to the images that are swapped.
//!
//! A probe may write the booted slot behind the bootloader's back. The state of a swap is then *stale*: with it the
//! bootloader would put older firmware over what the probe wrote. So the hub stores a checksum of each page of both slots
//! when it arms a swap. The bootloader compares the pages of the booted slot with these checksums, and discards a stale swap.
//!
//! The progress of a swap counts steps. Each page takes two steps: to the other slot, and from the other slot.
//!
//! ```text
//! progress     0             2 N              4 N
//!              | swap        | roll back      |
//! pages        | N-1 .. 0    | 0 .. N-1       |
//! ```
//!
//! The state is in words of the flash: the order, a mark, the progress, and at the end the checksums, page 0 last.

use super::{BLANK, StateFlash, WORD, checksum};
use embassy_boot::FirmwareState;
use embedded_storage_async::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Each byte of the order to swap (`SWAP_MAGIC` of embassy-boot, which keeps the constant to itself).
const SWAP: u8 = 0xF0;

/// Number of words in front of the progress.
const PROGRESS_AT: u32 = 2;

/// Bytes of the checksums of a page. The words of the state must not be shorter.
pub(super) const SUMS_BYTES: usize = 8;

/// CRC-32 of a page of both slots at the time of the order.
struct PageSums {
    /// The page of the booted slot.
    before: u32,
    /// The page of the new firmware.
    new: u32,
}

impl PageSums {
    /// Reads the checksums from a word of the state.
    fn read(word: &[u8]) -> Option<Self> {
        let (before, rest) = word.split_first_chunk()?;
        let (new, _) = rest.split_first_chunk()?;
        Some(Self { before: u32::from_le_bytes(*before), new: u32::from_le_bytes(*new) })
    }

    /// Checks the checksum of this page of the booted slot after so many steps of the swap.
    const fn fits(&self, sum: u32, page: u32, pages: u32, progress: u32) -> bool {
        let (steps, turn, from, to) = match progress.checked_sub(2 * pages) {
            None => (progress, pages - 1 - page, self.before, self.new),
            Some(steps) => (steps, page, self.new, self.before),
        };
        match steps.checked_sub(2 * turn) {
            None | Some(0) => sum == from,
            // The page is being erased and written.
            Some(1) => true,
            Some(_) => sum == to,
        }
    }
}

/// Returns the place of a page's checksums in the state.
fn sums_at<S: NorFlash>(state: &StateFlash<S>, page: u32) -> u32 {
    (state.capacity() as u32).saturating_sub((page + 1) * S::WRITE_SIZE as u32)
}

/// Orders the bootloader to swap the slots, and stores the checksums of the slots' pages.
pub(super) async fn order<A: ReadNorFlash, D: NorFlash, S: NorFlash>(
    booted: &mut A,
    download: &mut D,
    state: &mut StateFlash<S>,
) -> Result<(), NorFlashErrorKind> {
    let kind = |error: S::Error| error.kind();
    let mut buffer = [0; WORD];
    let word = buffer.get_mut(..S::WRITE_SIZE).unwrap_or_default();
    state.erase(0, state.capacity() as u32).await.map_err(kind)?;
    let length = D::ERASE_SIZE as u32;
    for page in 0..booted.capacity() as u32 / length {
        let before = checksum(booted, page * length, length).await?;
        let new = checksum(download, page * length, length).await?;
        let sums = [before, new].map(u32::to_le_bytes);
        word.iter_mut().zip(sums.as_flattened()).for_each(|(to, byte)| *to = *byte);
        state.write(sums_at(state, page), word).await.map_err(kind)?;
    }
    word.fill(SWAP);
    state.write(0, word).await.map_err(kind)
}

/// Discards an ordered or begun swap if the booted slot is not as the swap has left it. A bootloader calls this function
/// before it goes on with a swap.
///
/// # Errors
/// Returns the kind of the flash's error.
pub async fn discard_stale_swap<A: NorFlash, S: NorFlash>(
    booted: &mut A,
    state: &mut StateFlash<S>,
) -> Result<(), NorFlashErrorKind> {
    let kind = |error: S::Error| error.kind();
    let mut buffer = [0; WORD];
    let word = buffer.get_mut(..S::WRITE_SIZE).unwrap_or_default();
    state.read(0, word).await.map_err(kind)?;
    if word.iter().any(|byte| *byte != SWAP) {
        return Ok(());
    }
    let length = A::ERASE_SIZE as u32;
    let pages = booted.capacity() as u32 / length;
    let mut progress = 0;
    while progress < 4 * pages {
        state.read((PROGRESS_AT + progress) * S::WRITE_SIZE as u32, word).await.map_err(kind)?;
        if word.contains(&BLANK) {
            break;
        }
        progress += 1;
    }
    for page in 0..pages {
        let sum = checksum(booted, page * length, length).await?;
        state.read(sums_at(state, page), word).await.map_err(kind)?;
        if !PageSums::read(word).is_some_and(|sums| sums.fits(sum, page, pages, progress)) {
            let done = FirmwareState::new(state, word).mark_booted().await;
            return done.map_err(|_| NorFlashErrorKind::Other);
        }
    }
    Ok(())
}
