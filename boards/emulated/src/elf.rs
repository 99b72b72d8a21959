//! The firmware image: its file, its build, and its symbols.
//!
//! ```
//! use emulated::elf::{Symbol, find};
//!
//! let symbols = ["hub::control_task::poll", "hub::supply_task::poll"]
//!     .map(|name| Symbol { name: name.into(), address: 0x0800_0200, size: 4 });
//! assert_eq!(find(&symbols, "control_task..::poll"), Some(0x0800_0200));
//! // Two names end like this, so no address is returned.
//! assert_eq!(find(&symbols, "::poll"), None);
//! ```

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use object::{Object, ObjectSymbol};

use crate::board::Board;

const TARGET: &str = "thumbv7em-none-eabihf";

/// How an image is built.
#[derive(Clone, Copy, Debug)]
pub enum Variant<'a> {
    /// The image has the settings of the package.
    Usual,
    /// The firmware has this control period, in milliseconds.
    Period(u32),
    /// The firmware is for the slot from which the bootloader starts it.
    InSlot,
    /// The image accepts only firmware that a signer has signed. This file has the signer's public key.
    Signed(&'a Path),
}

/// Builds the image of a package, and returns its ELF file. Cargo builds nothing if the image is up to date.
pub fn build(package: &str, variant: Variant<'_>) -> PathBuf {
    let (image, options, variable) = match variant {
        Variant::Usual => (package.to_owned(), None, None),
        // The feature gives the board's crate a build of its own. Otherwise a build with one period would make the
        // build with the other period stale.
        Variant::Period(ms) => {
            let period = ("CONTROL_PERIOD_MS", ms.to_string());
            (format!("{package}-{ms}-ms"), Some("--features=own-period"), Some(period))
        }
        Variant::InSlot => (format!("{package}-in-slot"), Some("--features=bootloader"), None),
        Variant::Signed(key) => {
            let key = ("UPDATE_KEY", key.display().to_string());
            (format!("{package}-signed"), Some("--features=signed"), Some(key))
        }
    };
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target");
    let images = target.join("images");
    std::fs::create_dir_all(&images).expect("a folder for images");
    // Only one thread of one process builds and copies at a time.
    let turn = File::create(images.join("lock")).expect("a file to lock");
    turn.lock().expect("a lock");
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["build", "--quiet", "--package", package, "--target", TARGET, "--profile", "firmware"])
        .arg("--target-dir")
        .arg(&target)
        .args(options)
        .envs(variable)
        // Variables that `cargo test` sets for this crate are removed. Otherwise the image would be built again each
        // time.
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove("CARGO_TARGET_DIR");
    let status = command.status().expect("cargo runs");
    assert!(status.success(), "{package} does not build for {TARGET}");
    // All variants of a package have the same file in the target folder, so it is copied to a name of its own. A rename
    // replaces the old file, which another process may be reading.
    let (new, place) = (images.join("new"), images.join(image));
    std::fs::copy(target.join(TARGET).join("firmware").join(package), &new).expect("a copy of the image");
    std::fs::rename(&new, &place).expect("a new name for it");
    place
}

/// Why there is no image to run.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// The file cannot be read.
    #[error("{place}: {error}")]
    Unreadable {
        /// The option or variable, and its path.
        place: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
    /// The file is not the ELF file of a firmware.
    #[error("{place} is not the ELF file of a firmware")]
    NoFirmware {
        /// The option or variable, and its path.
        place: String,
    },
    /// This program was started outside of the sources that it was built from.
    #[error(
        "images are built from the sources in {sources}, and this program was not started there; give --image FILE"
    )]
    Elsewhere {
        /// The folder of the sources.
        sources: String,
    },
}

/// The image that runs instead of an image that is built from the sources.
static CHOSEN: OnceLock<PathBuf> = OnceLock::new();

/// Chooses the image to run: this file, or the file that `MOTOR_HUB_ELF` names. Without both, [`hub`] later builds an
/// image from the sources of this program.
///
/// # Errors
/// Returns an error if the file cannot be read, or is no firmware. Returns an error if the image would be built from
/// the sources of this program while the working directory is elsewhere.
pub fn choose(file: Option<&Path>) -> Result<(), ImageError> {
    let variable = std::env::var_os("MOTOR_HUB_ELF").map(PathBuf::from);
    let (place, file) = match (file, variable) {
        (Some(file), _) => (format!("--image {}", file.display()), file.to_owned()),
        (None, Some(file)) => (format!("MOTOR_HUB_ELF={}", file.display()), file),
        (None, None) => return in_the_sources(),
    };
    let image = match std::fs::read(&file) {
        Ok(image) => image,
        Err(error) => return Err(ImageError::Unreadable { place, error }),
    };
    if object::File::parse(&*image).is_err() || defmt_decoder::Table::parse(&image).is_err() {
        return Err(ImageError::NoFirmware { place });
    }
    CHOSEN.get_or_init(|| file);
    Ok(())
}

/// Checks that the working directory is in the sources that this program was built from.
fn in_the_sources() -> Result<(), ImageError> {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let found = (std::env::current_dir().and_then(|here| here.canonicalize()), sources.canonicalize());
    match found {
        (Ok(here), Ok(sources)) if here.starts_with(&sources) => Ok(()),
        _ => Err(ImageError::Elsewhere { sources: sources.display().to_string() }),
    }
}

/// Returns the image of a board's firmware: the image that [`choose`] or `MOTOR_HUB_ELF` names, otherwise one that is built from
/// the sources.
pub fn hub(board: Board) -> PathBuf {
    static BUILT: [OnceLock<PathBuf>; Board::ALL.len()] = [const { OnceLock::new() }; Board::ALL.len()];
    let named = || CHOSEN.get().cloned().or_else(|| std::env::var_os("MOTOR_HUB_ELF").map(PathBuf::from));
    BUILT[board as usize]
        .get_or_init(|| named().unwrap_or_else(|| build(board.name(), Variant::Usual)))
        .clone()
}

/// A function or variable.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Symbol {
    /// Demangled name.
    pub name: String,
    /// Address of the first byte, without the Thumb bit.
    pub address: u64,
    /// Size in bytes.
    pub size: u64,
}

/// Returns all symbols that have a size, in the order of their addresses.
pub fn symbols(elf: &[u8]) -> Vec<Symbol> {
    let file = object::File::parse(elf).expect("an ELF file");
    let mut symbols: Vec<Symbol> = file
        .symbols()
        .filter(|symbol| symbol.size() > 0)
        .map(|symbol| Symbol {
            name: format!("{:#}", rustc_demangle::demangle(symbol.name().unwrap_or_default())),
            address: symbol.address() & !1,
            size: symbol.size(),
        })
        .collect();
    symbols.sort_by_key(|symbol| symbol.address);
    symbols
}

/// Returns the address of the only symbol whose name contains the parts of `name` in this order and ends with the last part.
/// Parts are separated by `..`, as in `capture_task..::poll`. Returns `None` if no symbol or more than one has such a name.
#[must_use]
pub fn find(symbols: &[Symbol], name: &str) -> Option<u64> {
    let matches = |symbol: &&Symbol| {
        let (start, end) = name.rsplit_once("..").unwrap_or(("", name));
        let Some(mut rest) = symbol.name.strip_suffix(end) else {
            return false;
        };
        start.split("..").all(|part| match rest.split_once(part) {
            Some((_, after)) => {
                rest = after;
                true
            }
            None => false,
        })
    };
    let mut found = symbols.iter().filter(matches);
    let first = found.next()?;
    found.next().is_none().then_some(first.address)
}
