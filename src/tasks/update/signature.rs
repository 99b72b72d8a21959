//! Whose an image is: Ed25519 (RFC 8032) over its SHA-512, as [`embassy_boot`] has it.
//!
//! Not by that crate's own feature, which reads two bytes at a time and comes to no pause in between.

use super::{Outcome, Slots};
use crate::update::Seal;
use embedded_storage_async::nor_flash::NorFlash;
use salty::{PublicKey, Sha512, Signature};

impl<D: NorFlash, S: NorFlash> Slots<D, S> {
    /// Whether this is the signer's seal of what was written; `calm` is awaited before the core is held up by arithmetic.
    pub(super) async fn verify(
        &mut self,
        length: u32,
        seal: &Seal,
        calm: impl Future<Output = ()>,
    ) -> Outcome {
        let mut hash = Sha512::new();
        if self.each_chunk(length, |chunk| hash.update(chunk)).await.is_err() {
            return Outcome::Refused;
        }
        let hash = hash.finalize();
        calm.await;
        let signature = Signature::from(&seal.signature);
        match PublicKey::try_from(&seal.key) {
            Ok(key) if key.verify(&hash, &signature).is_ok() => Outcome::Done,
            _ => Outcome::WrongSignature,
        }
    }
}
