//! `motor-hub client update`.

mod image;
mod signature;

use super::hub::HubOptions;
use super::interrupt;
use crate::output::{Failure, print, progress};
use image::Image;
use indicatif::ProgressBar;
use motor_hub::extension::state::UpdateReport;
use motor_hub::protocol::Nack;
use motor_hub::update::{Booted, Phase, Seal};
use motor_hub_client::line::Line;
use motor_hub_client::reasons::{why_not_armed, why_not_started, why_unfit};
use motor_hub_client::{Error, Session};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Text of the long help.
pub(super) const HELP: &str = "\
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

/// Time-out for the hub to answer after the restart. It swaps slots and may swap back: 8 erasures of up to 4 s each way, and
/// the watchdog's time.
const RETURNING: Duration = Duration::from_secs(90);

/// Time-out for the new firmware to confirm itself, which erases flash.
const CONFIRMING: Duration = Duration::from_secs(15);

/// Interval between two questions to the restarting hub.
const LOOK: Duration = Duration::from_millis(200);

#[derive(clap::Args)]
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
    fn read(&self) -> Result<(Image, Option<Seal>), Failure> {
        let image = Image::open(&self.file).map_err(Failure::Input)?;
        let (Some(signature), Some(key)) = (&self.signature, &self.key) else { return Ok((image, None)) };
        if image.origin.is_some() {
            let file = self.file.display();
            return Err(Failure::Input(format!(
                "{file} is an ELF file, but a signature needs raw bytes: make them by llvm-objcopy -O binary, then sign and send them"
            )));
        }
        let seal = signature::open(signature, key).map_err(Failure::Input)?;
        Ok((image, Some(seal)))
    }

    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let (image, seal) = self.read()?;
        let session = &mut hub.open(None)?;
        let report = session.update_state().map_err(no_bootloader)?;
        fits(&image, &report)?;
        if report.phase == Phase::Armed {
            session.abandon_update()?;
        }
        let before = session.version()?;
        send(session, &image, seal)?;
        session.restart()?;
        let after = returned(session)?;
        let now = session.version()?;
        let why = match after.phase {
            Phase::Armed => Some("the hub did not restart".to_owned()),
            _ => why_not_started(after.booted, &image.version, &now),
        };
        match why {
            None => print(&format!("before: {before}\nnow:    {now}, confirmed\n")),
            Some(why) => Err(Failure::Work(why)),
        }
    }
}

/// Message for a hub that does not support updates.
fn no_bootloader(error: Error) -> Failure {
    match error {
        Error::Refused { reason: Nack::UNSUPPORTED | Nack::UNKNOWN, .. } | Error::TooOld { .. } => {
            Failure::work("the hub has no bootloader: flash new firmware through its debug probe")
        }
        error => error.into(),
    }
}

/// Checks that the image fits this hub's slot.
fn fits(image: &Image, report: &UpdateReport) -> Result<(), Failure> {
    let origin = report.origin;
    if let Some(linked) = image.origin.filter(|linked| *linked != origin) {
        return Err(Failure::Input(format!(
            "the image is linked to {linked:#010x}, but this hub's images begin at {origin:#010x}: build it for the bootloader"
        )));
    }
    why_unfit(&image.bytes, report).map_or(Ok(()), |why| Err(Failure::Input(why)))
}

fn send(session: &mut Session<Line>, image: &Image, seal: Option<Seal>) -> Result<(), Failure> {
    // After a signal the transfer is abandoned, so that the hub does not wait for the rest.
    interrupt::listen()?;
    let bar = progress(Some(image.bytes.len() as u64), "bytes");
    let report = session.send_image(&image.bytes, &image.version, seal, |sent| {
        bar.set_position(sent as u64);
        interrupt::wait(Instant::now())
    });
    bar.finish_and_clear();
    why_not_armed(&report?).map_or(Ok(()), |why| Err(Failure::work(why)))
}

/// Waits until the hub answers again, and has confirmed the new firmware or returned to the former one.
fn returned(session: &mut Session<Line>) -> Result<UpdateReport, Failure> {
    let (begun, mut answered) = (Instant::now(), None);
    let bar = ProgressBar::new_spinner().with_message("the hub swaps its firmware");
    loop {
        bar.tick();
        interrupt::wait(Instant::now() + LOOK)?;
        let report = session.update_state();
        let waited = match (&report, answered) {
            (Ok(_), None) => {
                answered = Some(Instant::now());
                false
            }
            (Ok(_), Some(since)) => since.elapsed() > CONFIRMING,
            (Err(_), _) => begun.elapsed() > RETURNING,
        };
        match report {
            Ok(report) => {
                let done = report.phase != Phase::Armed
                    && matches!(report.booted, Booted::Confirmed | Booted::WentBack | Booted::Unconfirmable);
                if done || waited {
                    bar.finish_and_clear();
                    return Ok(report);
                }
            }
            Err(error) if waited => return Err(error.into()),
            Err(Error::Silent { .. } | Error::Unexpected { .. }) => answered = None,
            Err(error) => return Err(error.into()),
        }
    }
}
