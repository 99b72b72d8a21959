//! Signature check of an image: Ed25519 (RFC 8032) over the image's SHA-512, like [`embassy_boot`]'s own check.
//!
//! That crate's own check reads two bytes at a time and does not let other tasks run in between. It is not used here.

use super::{Outcome, Slots};
use crate::update::Seal;
use embedded_storage_async::nor_flash::NorFlash;
use salty::{PublicKey, Sha512, Signature};

impl<D: NorFlash, S: NorFlash> Slots<D, S> {
    /// Checks that the seal is a valid signature of the written image. The arithmetic blocks the processor, so `motors_off`
    /// is awaited before.
    pub(super) async fn verify(
        &mut self,
        length: u32,
        seal: &Seal,
        motors_off: impl Future<Output = ()>,
    ) -> Outcome {
        let mut hash = Sha512::new();
        if self.each_chunk(length, |chunk| hash.update(chunk)).await.is_err() {
            return Outcome::Refused;
        }
        let hash = hash.finalize();
        motors_off.await;
        let signature = Signature::from(&seal.signature);
        match PublicKey::try_from(&seal.key) {
            Ok(key) if key.verify(&hash, &signature).is_ok() => Outcome::Done,
            _ => Outcome::WrongSignature,
        }
    }
}
