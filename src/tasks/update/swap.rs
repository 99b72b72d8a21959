//! Recognises a *stale* swap: the state of a swap whose images are not in the slots any more.
//!
//! A debug probe may write firmware to the active slot without the bootloader. If the bootloader then continued a swap,
//! it would overwrite the new firmware with older firmware. So the hub stores a checksum of each page of both slots
//! together with the swap mark. The bootloader compares the pages of the active slot with these checksums, and discards
//! a stale swap.
//!
//! The *progress* of a swap counts steps. Each page takes two steps. The first step copies the page of the active slot
//! to the download slot. The second step copies the other image's page to the active slot. With N pages in the active
//! slot:
//!
//! ```text
//! progress   0                   2 N                             4 N
//!            | swap               | restore the previous firmware |
//! pages      | N-1 first, 0 last  | 0 first, N-1 last             |
//! ```
//!
//! The bootloader's state has these words, from its first address to its last:
//!
//! | words | content |
//! |---|---|
//! | 1 | swap mark |
//! | 1 | blank; 0 while the state is erased, after the previous firmware was restored or the firmware was confirmed |
//! | 4 N | progress: the number of words without a blank byte, from the first word on |
//! | rest | unused |
//! | 96 bytes | length and signature of the new firmware; blank if it is not signed |
//! | N | CRC-32 of a page in the active slot and in the download slot, in descending order: page 0 is last |
//!
//! If the second word is not blank, embassy-boot takes the swap as ended and the previous firmware as restored. The
//! progress then counts as 4 N. If the power has failed while new firmware confirmed itself, the new firmware does not
//! have the checksums of the previous firmware, so the swap is stale: the new firmware is started and is confirmed.

use super::{BLANK, StateFlash, checksum};
use crate::tasks::WORD_BYTES;
use embassy_boot::FirmwareState;
use embedded_storage_async::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

/// Value of each byte of the swap mark. It is `SWAP_MAGIC` of embassy-boot, which is not public.
const SWAP: u8 = 0xF0;

/// Value of each byte of the first word after the previous firmware was restored. It is `REVERT_MAGIC` of embassy-boot,
/// which is not public.
#[cfg(feature = "signed")]
const REVERTED: u8 = 0xC0;

/// Index of the word that is blank while the progress is valid.
const VALIDITY_AT: u32 = 1;

/// Index of the first word of the progress.
const PROGRESS_AT: u32 = 2;

/// Size in bytes of a page's checksums in both slots. One word of the state holds them, so a word must have at least 8
/// bytes.
pub(super) const SUMS_BYTES: usize = 8;

/// True if `sum` is the checksum that the page number `page` of the active slot must have after `progress` steps.
/// `pages` is the number of pages. `word` is the word of the state with the page's checksums before the swap. False if
/// the word is too short.
fn fits(word: &[u8], sum: u32, page: u32, pages: u32, progress: u32) -> bool {
    let ([previous, new, ..], _) = word.as_chunks() else { return false };
    let (previous, new) = (u32::from_le_bytes(*previous), u32::from_le_bytes(*new));
    let (steps, pages_before, from, to) = match progress.checked_sub(2 * pages) {
        None => (progress, pages - 1 - page, previous, new),
        Some(steps) => (steps, page, new, previous),
    };
    match steps.checked_sub(2 * pages_before) {
        None | Some(0) => sum == from,
        // The page is being erased or written in this step, so any content is possible.
        Some(1) => true,
        Some(_) => sum == to,
    }
}

/// Returns the address of a page's checksums in the state.
fn sums_at<S: NorFlash>(state: &StateFlash<S>, page: u32) -> u32 {
    (state.capacity() as u32).saturating_sub((page + 1) * S::WRITE_SIZE as u32)
}

/// Size of length and signature in the state, in bytes: a multiple of each possible word.
const SIGNATURE_BYTES: usize = 96;

/// Returns the address of the new firmware's length and signature in the state.
fn signature_at<S: NorFlash>(state: &StateFlash<S>, pages: u32) -> u32 {
    sums_at(state, pages.saturating_sub(1)).saturating_sub(SIGNATURE_BYTES as u32)
}

/// Reads length and signature of the new firmware. All their bytes are 0xFF if the firmware was not signed.
#[cfg(feature = "signed")]
pub(super) async fn stored_signature<S: NorFlash>(
    state: &mut StateFlash<S>,
    pages: u32,
) -> Result<(u32, [u8; 64]), S::Error> {
    let (mut bytes, mut signature) = ([0; SIGNATURE_BYTES], [0; 64]);
    state.read(signature_at(state, pages), &mut bytes).await?;
    let (length, rest) = bytes.split_first_chunk().unwrap_or((&[0; 4], &[]));
    signature.iter_mut().zip(rest).for_each(|(to, byte)| *to = *byte);
    Ok((u32::from_le_bytes(*length), signature))
}

/// Stores length and signature of signed firmware, the checksums of the slots' pages, and then the swap mark.
pub(super) async fn mark<A: ReadNorFlash, D: NorFlash, S: NorFlash>(
    active: &mut A,
    download: &mut D,
    state: &mut StateFlash<S>,
    signature: Option<(u32, [u8; 64])>,
) -> Result<(), NorFlashErrorKind> {
    let kind = |error: S::Error| error.kind();
    let mut buffer = [0; WORD_BYTES];
    let word = buffer.get_mut(..S::WRITE_SIZE).unwrap_or_default();
    state.erase(0, state.capacity() as u32).await.map_err(kind)?;
    let length = D::ERASE_SIZE as u32;
    let pages = active.capacity() as u32 / length;
    if let Some((length, signature)) = signature {
        let mut bytes = [BLANK; SIGNATURE_BYTES];
        let stored = length.to_le_bytes().into_iter().chain(signature);
        bytes.iter_mut().zip(stored).for_each(|(to, byte)| *to = byte);
        state.write(signature_at(state, pages), &bytes).await.map_err(kind)?;
    }
    for page in 0..pages {
        let previous = checksum(active, page * length, length).await?;
        let new = checksum(download, page * length, length).await?;
        let sums = [previous, new].map(u32::to_le_bytes);
        word.iter_mut().zip(sums.as_flattened()).for_each(|(to, byte)| *to = *byte);
        state.write(sums_at(state, page), word).await.map_err(kind)?;
    }
    word.fill(SWAP);
    state.write(0, word).await.map_err(kind)
}

/// Discards a swap that is marked or begun, if the swap is stale. It is stale if a page of the active slot does not
/// have the checksum that the progress requires. A bootloader calls this function before it begins or continues a swap.
///
/// # Errors
/// Returns the kind of the flash's error.
pub async fn discard_stale_swap<A: NorFlash, S: NorFlash>(
    active: &mut A,
    state: &mut StateFlash<S>,
) -> Result<(), NorFlashErrorKind> {
    let kind = |error: S::Error| error.kind();
    let length = A::ERASE_SIZE as u32;
    let pages = active.capacity() as u32 / length;
    let Some(progress) = progress(state, pages).await.map_err(kind)? else { return Ok(()) };
    let mut buffer = [0; WORD_BYTES];
    let word = buffer.get_mut(..S::WRITE_SIZE).unwrap_or_default();
    for page in 0..pages {
        let sum = checksum(active, page * length, length).await?;
        state.read(sums_at(state, page), word).await.map_err(kind)?;
        if !fits(word, sum, page, pages, progress) {
            return discard(state).await;
        }
    }
    Ok(())
}

/// Returns the progress of the marked swap, with this number of pages in the active slot. `None` if no swap is marked.
/// The progress is 4 N if the power has failed before an erasure of the state.
pub(super) async fn progress<S: NorFlash>(
    state: &mut StateFlash<S>,
    pages: u32,
) -> Result<Option<u32>, S::Error> {
    let mut buffer = [0; WORD_BYTES];
    let word = buffer.get_mut(..S::WRITE_SIZE).unwrap_or_default();
    state.read(0, word).await?;
    if word.iter().any(|byte| *byte != SWAP) {
        return Ok(None);
    }
    state.read(VALIDITY_AT * S::WRITE_SIZE as u32, word).await?;
    if word.iter().any(|byte| *byte != BLANK) {
        return Ok(Some(4 * pages));
    }
    let mut progress = 0;
    while progress < 4 * pages {
        state.read((PROGRESS_AT + progress) * S::WRITE_SIZE as u32, word).await?;
        if word.contains(&BLANK) {
            break;
        }
        progress += 1;
    }
    Ok(Some(progress))
}

/// Discards the marked swap: the firmware in the active slot is started.
async fn discard<S: NorFlash>(state: &mut StateFlash<S>) -> Result<(), NorFlashErrorKind> {
    let mut buffer = [0; WORD_BYTES];
    let word = buffer.get_mut(..S::WRITE_SIZE).unwrap_or_default();
    FirmwareState::new(state, word).mark_booted().await.map_err(|_| NorFlashErrorKind::Other)
}

/// Discards the marked swap because the new firmware is refused. The firmware in the active slot is started, and reads
/// from the state that the new firmware was refused ([`Booted::Reverted`](crate::update::Booted::Reverted)).
#[cfg(feature = "signed")]
pub(super) async fn refuse<S: NorFlash>(state: &mut StateFlash<S>) -> Result<(), NorFlashErrorKind> {
    let kind = |error: S::Error| error.kind();
    state.erase(0, state.capacity() as u32).await.map_err(kind)?;
    let word = [REVERTED; WORD_BYTES];
    state.write(0, word.get(..S::WRITE_SIZE).unwrap_or_default()).await.map_err(kind)
}
