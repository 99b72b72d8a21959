//! Checks signed images: the signature, Ed25519 (RFC 8032) of the image's SHA-512 hash, and the rollback version.
//!
//! The check of [`embassy_boot`] is not used, because that check reads two bytes at a time and does not let other tasks
//! run.

use super::swap::{progress, refuse, stored_signature};
use super::{Outcome, Slots, StateFlash, each_chunk};
use crate::tasks::WORD_BYTES;
use crate::update::{ImageSignature, ROLLBACK_VERSION_AT};
use core::future::ready;
use embedded_storage_async::nor_flash::{NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use salty::{PublicKey, Sha512, Signature};

impl<A: ReadNorFlash, D: NorFlash, S: NorFlash> Slots<A, D, S> {
    /// Checks that the signature is valid for the written image, and that the image is not
    /// older than the present firmware. The arithmetic blocks the processor, so the method first awaits `motors_off`.
    pub(super) async fn verify(
        &mut self,
        length: u32,
        signature: &ImageSignature,
        motors_off: impl Future<Output = ()>,
    ) -> Outcome {
        check(&mut self.active, &mut self.download, length, signature, motors_off)
            .await
            .unwrap_or(Outcome::Refused)
    }
}

/// Checks the new firmware in the download slot against its signature and the present firmware.
async fn check<A: ReadNorFlash, D: ReadNorFlash>(
    active: &mut A,
    download: &mut D,
    length: u32,
    signature: &ImageSignature,
    motors_off: impl Future<Output = ()>,
) -> Result<Outcome, NorFlashErrorKind> {
    let mut hash = Sha512::new();
    each_chunk(download, 0, length, |chunk| hash.update(chunk)).await.map_err(|error| error.kind())?;
    let hash = hash.finalize();
    let present = rollback_version(active, active.capacity() as u32).await.map_err(|error| error.kind())?;
    let new = rollback_version(download, length).await.map_err(|error| error.kind())?;
    motors_off.await;
    let bytes = Signature::from(&signature.bytes);
    Ok(match PublicKey::try_from(&signature.key) {
        Ok(key) if key.verify(&hash, &bytes).is_ok() => {
            if new < present {
                Outcome::Older
            } else {
                Outcome::Done
            }
        }
        _ => Outcome::WrongSignature,
    })
}

/// Returns the rollback version of the firmware in a slot. Firmware that is too short for a version has version 0.
async fn rollback_version<F: ReadNorFlash>(slot: &mut F, length: u32) -> Result<u32, F::Error> {
    if length < ROLLBACK_VERSION_AT + 4 {
        return Ok(0);
    }
    let mut word = [0; WORD_BYTES];
    slot.read(ROLLBACK_VERSION_AT, &mut word).await?;
    Ok(word.first_chunk().map_or(0, |number| u32::from_le_bytes(*number)))
}

/// Discards a swap that is marked and has not begun, unless the new firmware has a valid signature by this key and is
/// not older than the present firmware. The present firmware then finds
/// [`Booted::Reverted`](crate::update::Booted::Reverted). A bootloader with a key calls this function before it begins
/// a swap.
///
/// # Errors
/// Returns the kind of the flash's error.
pub async fn discard_refused_swap<A: NorFlash, D: NorFlash, S: NorFlash>(
    active: &mut A,
    download: &mut D,
    state: &mut StateFlash<S>,
    key: [u8; 32],
) -> Result<(), NorFlashErrorKind> {
    let capacity = active.capacity() as u32;
    let pages = capacity / A::ERASE_SIZE as u32;
    if progress(state, pages).await.map_err(|error| error.kind())? != Some(0) {
        return Ok(());
    }
    let (length, bytes) = stored_signature(state, pages).await.map_err(|error| error.kind())?;
    // The length of unsigned firmware reads as 2^32 - 1, which is too long.
    let accepted = length <= capacity
        && check(active, download, length, &ImageSignature { key, bytes }, ready(())).await? == Outcome::Done;
    if accepted { Ok(()) } else { refuse(state).await }
}
