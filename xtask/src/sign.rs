//! `cargo xtask sign`: makes the raw bytes of an image, with a rollback version if one is given, and their signature.

use crate::tool::{Failed, command, llvm, run};
use std::path::Path;

/// Position of the rollback version in an image: `motor_hub::update::ROLLBACK_VERSION_AT`.
const VERSION_AT: usize = 0x20;

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let (elf, secret, version) = match arguments {
        [elf, secret] => (elf, secret, None),
        [elf, secret, version] => (elf, secret, Some(number(version)?)),
        _ => {
            return Err(Failed(
                "give the ELF file, the secret key in PEM, and a rollback version, if any".to_owned(),
            ));
        }
    };
    let absolute = |name: &str| std::path::absolute(name).map_err(|error| Failed::at(Path::new(name), error));
    let (elf, secret) = (absolute(elf)?, absolute(secret)?);
    let [bin, hash, signature] = ["bin", "sha512", "sig"].map(|end| elf.with_extension(end));
    run(command(llvm("llvm-objcopy")?).args(["--output-target", "binary"]).arg(&elf).arg(&bin))?;
    if let Some(version) = version {
        let mut bytes = std::fs::read(&bin).map_err(|error| Failed::at(&bin, error))?;
        stamp(&mut bytes, version)?;
        std::fs::write(&bin, bytes).map_err(|error| Failed::at(&bin, error))?;
    }
    run(command("openssl").args(["dgst", "-sha512", "-binary", "-out"]).arg(&hash).arg(&bin))?;
    run(command("openssl")
        .args(["pkeyutl", "-sign", "-rawin", "-inkey"])
        .arg(secret)
        .arg("-in")
        .arg(&hash)
        .arg("-out")
        .arg(&signature))?;
    std::fs::remove_file(&hash).map_err(|error| Failed::at(&hash, error))?;
    println!("send {} with --signature {}", bin.display(), signature.display());
    Ok(())
}

/// Reads a rollback version.
fn number(text: &str) -> Result<u32, Failed> {
    text.parse().map_err(|_| {
        Failed(format!("the rollback version is a number from 0 to {}; given: {text}", u32::MAX))
    })
}

/// Puts a rollback version into an image.
fn stamp(image: &mut [u8], version: u32) -> Result<(), Failed> {
    match image.get_mut(VERSION_AT..VERSION_AT + 4) {
        // The vector is reserved, so the linker leaves zeros.
        Some(place) if place == [0; 4] => {
            place.copy_from_slice(&version.to_le_bytes());
            Ok(())
        }
        _ => Err(Failed("the file does not begin with the vector table of an image".to_owned())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rollback_version_stands_in_the_reserved_vector_and_nowhere_else() {
        let mut image = [0xA5; 64];
        image[32..36].fill(0);
        assert!(stamp(&mut image, 0x0102_0304).is_ok());
        assert_eq!(image[28..40], [0xA5, 0xA5, 0xA5, 0xA5, 4, 3, 2, 1, 0xA5, 0xA5, 0xA5, 0xA5]);
        assert!(stamp(&mut image, 1).is_err(), "it has one");
        assert!(stamp(&mut [0; 35], 1).is_err());
        assert!(number("-1").is_err() && number("4294967296").is_err());
    }
}
