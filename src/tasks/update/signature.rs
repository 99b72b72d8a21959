//! Checks the signature of an image: Ed25519 (RFC 8032) of the image's SHA-512 hash.
//!
//! The check of [`embassy_boot`] is not used, because that check reads two bytes at a time and does not let other tasks run.

use super::{Outcome, Slots, each_chunk};
use crate::update::Seal;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use salty::{PublicKey, Sha512, Signature};

impl<A: ReadNorFlash, D: NorFlash, S: NorFlash> Slots<A, D, S> {
    /// Checks that the seal has a valid signature of the written image by the seal's key. The arithmetic blocks the processor, so
    /// the method awaits `motors_off` before.
    pub(super) async fn verify(
        &mut self,
        length: u32,
        seal: &Seal,
        motors_off: impl Future<Output = ()>,
    ) -> Outcome {
        let mut hash = Sha512::new();
        if each_chunk(&mut self.download, 0, length, |chunk| hash.update(chunk)).await.is_err() {
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
