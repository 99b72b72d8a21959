//! `motor-hub client update`.

mod image;
mod seal;

use super::interrupt;
use super::trouble::Trouble;
use crate::output::{Failure, print, progress};
use image::Image;
use indicatif::ProgressBar;
use motor_hub::protocol::Nack;
use motor_hub::protocol::update::UpdateReport;
use motor_hub::update::{Booted, Outcome, Phase, Seal};
use motor_hub_client::line::Line;
use motor_hub_client::{Error, Session};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// Text of the long help.
pub(super) const HELP: &str = "\
Sends new firmware to a hub that has a bootloader, and starts it

FILE is what the compiler made (ELF), or raw bytes from the slot's first address on. It is written beside the firmware that \
runs, checked by what the flash reads back (CRC-32), and swapped in by a restart, which takes some 20 s on a NUCLEO-H743ZI2. \
The new firmware confirms itself once all of its tasks are at work; if it never does, the hub goes back to the firmware before, \
and this says so. All motors must be off. A power cut at any step costs the update at most.

A hub that was built with a public key takes only what that key's owner has signed. With OpenSSL from 3.0 on, once:

    openssl genpkey -algorithm ed25519 -out secret.pem
    openssl pkey -in secret.pem -pubout -outform DER -out public.der

and of each image, as raw bytes (llvm-objcopy -O binary hub.elf hub.bin), the signature of its SHA-512:

    openssl dgst -sha512 -binary -out hub.sha512 hub.bin
    openssl pkeyutl -sign -rawin -inkey secret.pem -in hub.sha512 -out hub.sig
    motor-hub client update hub.bin --signature hub.sig --key public.der";

/// The hub swaps, tries, and may swap back: 8 erasures of up to 4 s each way, and the watchdog's time.
const RETURNING: Duration = Duration::from_secs(90);

/// It confirms itself, and erases for it.
const CONFIRMING: Duration = Duration::from_secs(15);

const LOOK: Duration = Duration::from_millis(200);

#[derive(clap::Args)]
pub(crate) struct Options {
    /// The firmware: an ELF file, or raw bytes
    #[arg(value_name = "FILE")]
    file: PathBuf,

    /// The signature of FILE, which must be raw bytes then: 64 bytes, as openssl writes them
    #[arg(long, value_name = "SIG", requires = "key")]
    signature: Option<PathBuf>,

    /// The signer's public key, as openssl writes it in DER
    #[arg(long, value_name = "KEY", requires = "signature")]
    key: Option<PathBuf>,
}

impl Options {
    /// What can be wrong before a hub is asked.
    pub(super) fn check(&self) -> Result<(), Failure> {
        self.read().map(drop)
    }

    fn read(&self) -> Result<(Image, Option<Seal>), Failure> {
        let image = Image::open(&self.file).map_err(Failure::Input)?;
        let (Some(signature), Some(key)) = (&self.signature, &self.key) else { return Ok((image, None)) };
        if image.origin.is_some() {
            let file = self.file.display();
            return Err(Failure::Input(format!(
                "{file} is an ELF file, and a signature is of raw bytes: make these with llvm-objcopy -O binary, and sign and send them"
            )));
        }
        let seal = seal::open(signature, key).map_err(Failure::Input)?;
        Ok((image, Some(seal)))
    }

    pub(super) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let (image, seal) = self.read()?;
        let report = session.update_state().map_err(no_bootloader)?;
        fits(&image, &report)?;
        if report.phase == Phase::Armed {
            session.abandon_update()?;
        }
        let before = session.version()?;
        send(session, &image, seal)?;
        session.restart()?;
        let after = returned(session)?;
        let done = match after.booted {
            Booted::WentBack => Err(format!(
                "{} did not confirm itself, and the hub went back to {}",
                image.version,
                session.version()?
            )),
            _ if after.phase == Phase::Armed => Err("the hub did not restart".to_owned()),
            Booted::Confirmed => Ok(session.version()?),
            Booted::OnTrial | Booted::Unknown => {
                Err("the new firmware runs, and does not say that it stays".to_owned())
            }
        };
        match done {
            Ok(now) if now == image.version => {
                Ok(print(&format!("before: {before}\nnow:    {now}, confirmed\n"))?)
            }
            Ok(now) => {
                Err(Failure::Work(format!("the hub runs {now}, and was sent {}", image.version)).into())
            }
            Err(why) => Err(Failure::Work(why).into()),
        }
    }
}

/// A hub that knows no updates.
fn no_bootloader(error: Error) -> Trouble {
    match error {
        Error::Refused { reason: Nack::UNSUPPORTED | Nack::UNKNOWN, .. } | Error::TooOld { .. } => {
            Failure::work("the hub has no bootloader: new firmware reaches it through its probe only").into()
        }
        error => error.into(),
    }
}

/// Whether the image can be for this hub.
fn fits(image: &Image, report: &UpdateReport) -> Result<(), Failure> {
    let UpdateReport { origin, capacity, .. } = *report;
    if let Some(linked) = image.origin.filter(|linked| *linked != origin) {
        return Err(Failure::Input(format!(
            "the image is linked to {linked:#010x}, and this hub's begin at {origin:#010x}: build it for the bootloader"
        )));
    }
    if image.bytes.len() > capacity as usize {
        let length = image.bytes.len();
        return Err(Failure::Input(format!("the image has {length} bytes, and the slot {capacity}")));
    }
    let entry = image.entry().unwrap_or_default();
    if entry.wrapping_sub(origin) >= capacity {
        return Err(Failure::Input(format!(
            "the image's code begins at {entry:#010x}, and this hub's slot is {origin:#010x} to {:#010x}: \
             it is for another chip, or not built for the bootloader",
            origin.wrapping_add(capacity)
        )));
    }
    Ok(())
}

fn send(session: &mut Session<Line>, image: &Image, seal: Option<Seal>) -> Result<(), Trouble> {
    // Ended by a signal, the hub need not wait for the rest.
    interrupt::listen()?;
    let bar = progress(Some(image.bytes.len() as u64), "bytes");
    let report = session.send_image(&image.bytes, &image.version, seal, |sent| {
        bar.set_position(sent as u64);
        interrupt::wait(Instant::now()).map_err(Trouble::from)
    });
    bar.finish_and_clear();
    let report = report?;
    let why = match (report.phase, report.outcome) {
        (Phase::Armed, _) => return Ok(()),
        (_, Outcome::Mismatch) => "what the hub's flash reads back is not what was sent",
        (_, Outcome::WrongSignature) => "the signature is not one of this file by the hub's key",
        (_, Outcome::Refused) => "the hub's flash refused",
        _ => "the hub is still at it; it looks at a signature only while no motor runs",
    };
    Err(Failure::work(why).into())
}

/// Waits until the hub answers again, and has confirmed its firmware, or gone back.
fn returned(session: &mut Session<Line>) -> Result<UpdateReport, Trouble> {
    let (begun, mut heard) = (Instant::now(), None);
    let bar = ProgressBar::new_spinner().with_message("the hub swaps its firmware");
    loop {
        bar.tick();
        interrupt::wait(Instant::now() + LOOK)?;
        let report = session.update_state();
        let waited = match (&report, heard) {
            (Ok(_), None) => {
                heard = Some(Instant::now());
                false
            }
            (Ok(_), Some(since)) => since.elapsed() > CONFIRMING,
            (Err(_), _) => begun.elapsed() > RETURNING,
        };
        match report {
            Ok(report) => {
                let done = report.phase != Phase::Armed
                    && matches!(report.booted, Booted::Confirmed | Booted::WentBack);
                if done || waited {
                    bar.finish_and_clear();
                    return Ok(report);
                }
            }
            Err(error) if waited => return Err(error.into()),
            Err(Error::Silent { .. } | Error::Unexpected { .. }) => heard = None,
            Err(error) => return Err(error.into()),
        }
    }
}
