//! Implements the command `motor-hub client update`.

mod image;

use super::hub::HubOptions;
use super::interrupt;
use crate::output::{Failure, print, progress};
use indicatif::ProgressBar;
use motor_hub::update::ImageSignature;
use motor_hub_client::Session;
use motor_hub_client::update::{Image, Progress, UpdateError, Updating, read_key, read_signature};
use simulated::scenario::read_at_most;
use std::fmt::Display;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Text of the long help.
const HELP: &str = "\
Sends new firmware to a hub that has a bootloader, and starts it

FILE is an ELF file, or raw bytes from the slot's first address on. The hub writes it to a second slot while the present \
firmware runs, and checks it by reading the flash back (CRC-32). A restart then swaps the two, which takes some 20 s on a \
NUCLEO-H743ZI2.

The new firmware confirms itself once all its tasks run. If it does not, the hub returns to the former firmware, and this \
command reports that. All motors must be disabled. After a power cut at any step at most the update is lost.

A hub that was built with a public key accepts only images signed by that key. Make the keys once, with OpenSSL 3.0 or later:

    openssl genpkey -algorithm ed25519 -out secret.pem
    openssl pkey -in secret.pem -pubout -outform DER -out public.der

Sign the SHA-512 of each image as raw bytes (llvm-objcopy -O binary hub.elf hub.bin):

    openssl dgst -sha512 -binary -out hub.sha512 hub.bin
    openssl pkeyutl -sign -rawin -inkey secret.pem -in hub.sha512 -out hub.sig
    motor-hub client update hub.bin --signature hub.sig --key public.der

An image may have a rollback version: a number in its bytes 32 to 35, lowest byte first. Such a hub refuses an image whose \
number is lower than its firmware's.";

/// Text for an update that a signal can no longer cancel.
const GOES_ON: &str = "the update goes on without this command: the hub exchanges the images or tries the new firmware, and answers \
                       again after some 20 s; look at its version with `client status` then";

/// Largest file in bytes that is read. An ELF file of this project has some 7 MB, nearly all of it debug information.
const LARGEST_FILE: u64 = 64 << 20;

/// Interval between two steps while the hub writes.
const WRITES: Duration = Duration::from_millis(20);
/// Interval between two steps while the hub restarts.
const RESTARTS: Duration = Duration::from_millis(200);

/// Sends new firmware to a hub with a bootloader, starts it, and waits until it has confirmed itself
#[derive(clap::Args)]
#[command(long_about = HELP)]
pub(crate) struct Options {
    /// Firmware: an ELF file, or raw bytes
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// File with the signature of FILE: 64 bytes, as openssl writes them; FILE must be raw bytes
    #[arg(long, value_name = "SIG", requires = "key")]
    signature: Option<PathBuf>,

    /// File with the signer's public key in DER, as openssl writes it
    #[arg(long, value_name = "KEY", requires = "signature")]
    key: Option<PathBuf>,
}

impl Options {
    fn read(&self) -> Result<(Image, Option<ImageSignature>), Failure> {
        let image = read_file(&self.file, |bytes| image::read(bytes.to_vec()))?;
        let (Some(signature), Some(key)) = (&self.signature, &self.key) else { return Ok((image, None)) };
        if image.origin.is_some() {
            let file = self.file.display();
            return Err(Failure::Input(format!(
                "{file} is an ELF file, but a signature needs raw bytes: make them by llvm-objcopy -O binary, then sign and send them"
            )));
        }
        let signature =
            ImageSignature { bytes: read_file(signature, read_signature)?, key: read_file(key, read_key)? };
        Ok((image, Some(signature)))
    }

    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let (image, signature) = self.read()?;
        let session = &mut hub.open(None)?;
        let before = session.version()?;
        // After a signal the command makes the hub discard the image, so that the hub neither waits for the remaining
        // chunks nor starts the image at its next reset.
        interrupt::listen()?;
        let bar = progress(Some(image.bytes.len() as u64), "bytes");
        let mut updating = Updating::begin(session, image, signature)?;
        let now = follow(session, &mut updating, bar);
        if now.is_err() {
            updating.abandon(session);
        }
        let now = now.map_err(|failure| match failure {
            Failure::Stopped(_) if updating.restarts() => Failure::Work(format!("{failure}: {GOES_ON}")),
            failure => failure,
        })?;
        print(&format!("before: {before}\nnow:    {now}, confirmed\n"))
    }
}

/// Reads a file, and parses its bytes.
fn read_file<T, E: Display>(file: &Path, parse: impl FnOnce(&[u8]) -> Result<T, E>) -> Result<T, Failure> {
    let wrong = |why: &dyn Display| Failure::Input(format!("{}: {why}", file.display()));
    let bytes = File::open(file).and_then(|file| read_at_most(LARGEST_FILE, file));
    let bytes = bytes.map_err(|error| wrong(&error))?;
    parse(&bytes).map_err(|why| wrong(&why))
}

/// Takes steps until the new firmware has confirmed itself. Returns the version that the new firmware reports.
fn follow(session: &mut Session, updating: &mut Updating, mut bar: ProgressBar) -> Result<String, Failure> {
    loop {
        let mut pause = Duration::ZERO;
        match updating.step(session)? {
            Some(Progress::Sending(bytes)) => bar.set_position(bytes as u64),
            Some(Progress::Checking) => (),
            Some(Progress::Restarting) => {
                bar.finish_and_clear();
                bar = ProgressBar::new_spinner().with_message("the hub swaps its firmware");
            }
            Some(Progress::Confirmed(version)) => {
                bar.finish_and_clear();
                return Ok(version);
            }
            None => pause = if updating.restarts() { RESTARTS } else { WRITES },
        }
        bar.tick();
        interrupt::wait(Instant::now() + pause)?;
    }
}

impl From<UpdateError> for Failure {
    fn from(error: UpdateError) -> Self {
        match error {
            UpdateError::Unfit(why) => Self::Input(why),
            UpdateError::Failed(why) => Self::Work(why),
            UpdateError::Hub(error) => Self::Hub(error),
        }
    }
}
