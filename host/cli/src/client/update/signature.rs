//! Reads a signature and its public key from files.

use motor_hub::update::ImageSignature;
use motor_hub_client::update::{read_key, read_signature};
use std::fmt::Display;
use std::path::Path;

/// Reads a file with the signature alone, and a file with the public key in DER.
pub(super) fn open(signature: &Path, key: &Path) -> Result<ImageSignature, String> {
    Ok(ImageSignature { bytes: read(signature, read_signature)?, key: read(key, read_key)? })
}

fn read<T, E: Display>(file: &Path, parse: impl FnOnce(&[u8]) -> Result<T, E>) -> Result<T, String> {
    let named = |why: &dyn Display| format!("{}: {why}", file.display());
    let bytes = std::fs::read(file).map_err(|error| named(&error))?;
    parse(&bytes).map_err(|why| named(&why))
}
