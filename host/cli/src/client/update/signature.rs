//! Reads a signature and its public key from files.

use motor_hub::update::{Seal, public_key};
use std::path::Path;

/// Reads a file with the signature alone, and a file with the public key in DER.
pub(super) fn open(signature: &Path, key: &Path) -> Result<Seal, String> {
    let bytes = read(signature)?;
    let length = bytes.len();
    let signature = bytes
        .try_into()
        .map_err(|_| format!("{}: has {length} bytes; an Ed25519 signature has 64", signature.display()))?;
    let key = public_key(&read(key)?).ok_or_else(|| {
        format!(
            "{}: is not an Ed25519 public key in DER; make it by openssl pkey -pubout -outform DER",
            key.display()
        )
    })?;
    Ok(Seal { key, signature })
}

fn read(file: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(file).map_err(|error| format!("{}: {error}", file.display()))
}
