//! Updates the firmware of a hub with a bootloader, one step at a time.
//!
//! ```text
//! announcing --> sending --> checking --restart--> restarting --> confirmed
//! ```

use crate::clock::Instant;
use crate::{Error, Session};
use motor_hub::extension::HubFunction;
use motor_hub::extension::state::UpdateReport;
use motor_hub::protocol::Nack;
use motor_hub::protocol::payload::{TEXT, Text};
use motor_hub::update::{Booted, CHUNK, CRC, ImageSignature, Outcome, Phase, public_key};
use std::time::Duration;

/// Largest image in bytes: more than the flash of any supported chip.
pub const LARGEST_IMAGE: usize = 4 << 20;

/// Number of chunks that one step sends. With 50 steps a second the rate is about 20 kB/s. A serial line carries 46
/// kB/s.
const CHUNKS: usize = 4;

/// Time-out of a write or a check in the hub: erasing a page takes up to 4 s, erasing the bootloader's state another 4
/// s.
const WRITING: Duration = Duration::from_secs(10);

/// Time-out for the hub to answer after the restart. The bootloader swaps the slots, which takes 8 erasures of up to 4
/// s each. If the new firmware fails, the watchdog resets the hub and the bootloader swaps the slots back.
const RETURNING: Duration = Duration::from_secs(90);

/// Time-out for the new firmware to confirm itself. The confirmation erases flash.
const CONFIRMING: Duration = Duration::from_secs(15);

/// New firmware.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// The bytes of the hub's slot, from its first address on.
    pub bytes: Vec<u8>,
    /// The version that the hub reports once it runs the image.
    pub version: String,
    /// Flash address of the image's first byte; `None` if this address is unknown.
    pub origin: Option<u32>,
}

/// Why an update failed. The hub runs its former firmware, unless the text says otherwise.
#[derive(Debug, thiserror::Error)]
pub enum UpdateError {
    /// The image is not for this hub.
    #[error("{0}")]
    Unfit(String),
    /// The hub cannot be updated, or the update did not succeed.
    #[error("{0}")]
    Failed(String),
    /// A request failed.
    #[error("{0}")]
    Hub(#[from] Error),
}

/// Progress of an update.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The hub has received this many bytes of the image.
    Sending(usize),
    /// The hub checks the image.
    Checking,
    /// The hub restarts with the new firmware. It does not answer during the restart.
    Restarting,
    /// The hub runs the new firmware, which has confirmed itself. The text is the version that the hub reports.
    Confirmed(String),
}

/// Progress of one step; `None` if nothing has changed.
type Step = Result<Option<Progress>, UpdateError>;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Stage {
    /// The image is not announced yet. The hub may first have to delete an earlier image.
    Announcing,
    /// The hub has received this many bytes.
    Sending(usize),
    Checking,
    /// `answered` is the time of the first answer after the restart; `None` while the hub is silent.
    Restarting {
        answered: Option<Instant>,
    },
}

/// A running update. All motors must be disabled.
#[derive(Debug)]
pub struct Updating {
    image: Image,
    signature: Option<ImageSignature>,
    stage: Stage,
    /// Time of the last progress.
    since: Instant,
}

impl Updating {
    /// Announces an image to the hub. A hub that was built with a public key accepts only an image with a `signature` by
    /// that key. A hub without a key refuses any signature. The caller then takes steps until the new firmware has confirmed
    /// itself. After an error of a step the caller calls [`abandon`](Self::abandon).
    ///
    /// # Errors
    /// The hub has no bootloader, the image does not fit, or the hub refuses it.
    pub fn begin(
        session: &mut Session,
        image: Image,
        signature: Option<ImageSignature>,
    ) -> Result<Self, UpdateError> {
        let mut updating = Self { image, signature, stage: Stage::Announcing, since: Instant::now() };
        match updating.announce(session) {
            Ok(_) => Ok(updating),
            Err(error) => {
                updating.abandon(session);
                Err(error)
            }
        }
    }

    /// Takes one step of the update. Returns the progress if there is any. Call this function about 50 times a second,
    /// or less often while the hub restarts.
    ///
    /// # Errors
    /// The update has failed. After an error of the line the update continues if further steps get a new session.
    pub fn step(&mut self, session: &mut Session) -> Result<Option<Progress>, UpdateError> {
        let news = match self.stage {
            Stage::Announcing => self.announce(session),
            Stage::Sending(at) => self.send(session, at),
            Stage::Checking => self.check(session),
            Stage::Restarting { .. } => self.returned(session),
        }?;
        if news.is_some() {
            self.since = Instant::now();
        } else if let Some(why) = self.late() {
            return Err(UpdateError::Failed(why.to_owned()));
        }
        Ok(news)
    }

    /// True while the hub may be silent because it restarts.
    #[must_use]
    pub const fn restarts(&self) -> bool {
        matches!(self.stage, Stage::Restarting { .. })
    }

    /// Share of the image that the hub has received, 0 to 100 percent.
    #[must_use]
    pub fn percent(&self) -> usize {
        match self.stage {
            Stage::Announcing => 0,
            Stage::Sending(at) => 100 * at / self.image.bytes.len().max(1),
            Stage::Checking | Stage::Restarting { .. } => 100,
        }
    }

    /// Why the update has failed, if the time-out of the present stage is over; `None` before the time-out.
    #[must_use]
    pub fn late(&self) -> Option<&'static str> {
        let (since, longest, why) = match self.stage {
            Stage::Announcing => (self.since, WRITING, "the hub has not forgotten an earlier image"),
            Stage::Sending(_) => (self.since, WRITING, "the hub has not finished a write"),
            Stage::Checking => (self.since, WRITING, NOT_CHECKED),
            Stage::Restarting { answered: None } => (self.since, RETURNING, NOT_ANSWERED),
            Stage::Restarting { answered: Some(answered) } => (answered, CONFIRMING, NOT_CONFIRMED),
        };
        (since.elapsed() > longest).then_some(why)
    }

    /// Makes the hub discard an image that is not complete or not checked, also during the check. If this request fails
    /// before the check, the image is never started. If the request fails during the check, a correct image starts at the
    /// hub's next reset. The next update discards both.
    pub fn abandon(&self, session: &mut Session) {
        if matches!(self.stage, Stage::Sending(_) | Stage::Checking) {
            let _ = session.command(HubFunction::AbandonUpdate);
        }
    }

    fn announce(&mut self, session: &mut Session) -> Step {
        let report = session.update_state().map_err(|error| match error {
            Error::Refused { reason: Nack::UNSUPPORTED | Nack::UNKNOWN, .. } | Error::TooOld { .. } => {
                UpdateError::Failed(NO_BOOTLOADER.to_owned())
            }
            error => error.into(),
        })?;
        if let Some(why) = why_unfit(&self.image, &report) {
            return Err(UpdateError::Unfit(why));
        }
        if is_busy(&report) {
            return Ok(None);
        }
        if report.phase == Phase::Armed {
            session.command(HubFunction::AbandonUpdate)?;
            return Ok(None);
        }
        let Image { bytes, version, .. } = &self.image;
        let length = u32::try_from(bytes.len()).unwrap_or(u32::MAX);
        let version = version.as_bytes();
        let version = Text::from_slice(version.get(..TEXT).unwrap_or(version)).unwrap_or_default();
        // The hub takes from its last control tick whether motors are disabled.
        session.catch_up()?;
        session.command(HubFunction::BeginUpdate { length, crc: CRC.checksum(bytes), version })?;
        self.stage = Stage::Sending(0);
        if let Some(ImageSignature { key, bytes }) = self.signature {
            session.command(HubFunction::Sign { key, signature: bytes })?;
        }
        Ok(Some(Progress::Sending(0)))
    }

    fn send(&mut self, session: &mut Session, from: usize) -> Step {
        let mut at = from;
        for _ in 0..CHUNKS {
            let rest = self.image.bytes.get(at..).unwrap_or_default();
            let chunk = rest.get(..CHUNK).unwrap_or(rest);
            let request = if chunk.is_empty() {
                HubFunction::FinishUpdate
            } else {
                let offset = u32::try_from(at).unwrap_or(u32::MAX);
                HubFunction::Chunk { offset, bytes: Text::from_slice(chunk).unwrap_or_default() }
            };
            match session.command(request) {
                // The hub has not finished writing the earlier chunks.
                Err(Error::Refused { reason: Nack::UPDATE_BUSY, .. }) => break,
                // A write or the check has failed, and the hub has forgotten the image. The answer that came before this
                // refusal may be lost.
                Err(error @ Error::Refused { reason: Nack::UPDATE_NOT_BEGUN, .. }) => {
                    let why = why_failed(session.update_state()?.outcome);
                    return Err(why.map_or_else(|| error.into(), |why| UpdateError::Failed(why.to_owned())));
                }
                sent => sent?,
            }
            if chunk.is_empty() {
                self.stage = Stage::Checking;
                return Ok(Some(Progress::Checking));
            }
            at += chunk.len();
            self.stage = Stage::Sending(at);
        }
        Ok((at > from).then_some(Progress::Sending(at)))
    }

    fn check(&mut self, session: &mut Session) -> Step {
        let report = session.update_state()?;
        if is_busy(&report) {
            return Ok(None);
        }
        if report.phase != Phase::Armed {
            let why = why_failed(report.outcome).unwrap_or(NOT_CHECKED);
            return Err(UpdateError::Failed(why.to_owned()));
        }
        session.catch_up()?;
        match session.command(HubFunction::Restart) {
            // The acknowledgement may be lost. A hub that restarts does not answer the retransmissions. A hub that has
            // restarted refuses them. The next steps find out which firmware runs.
            Err(Error::Silent { .. } | Error::Refused { reason: Nack::UPDATE_NOT_ARMED, .. }) => (),
            done => done?,
        }
        self.stage = Stage::Restarting { answered: None };
        Ok(Some(Progress::Restarting))
    }

    fn returned(&mut self, session: &mut Session) -> Step {
        let report = match session.update_state() {
            Ok(report) => report,
            Err(error @ (Error::Line(_) | Error::HungUp)) => return Err(error.into()),
            // A starting hub is silent, or its answer is damaged.
            Err(_) => {
                self.stage = Stage::Restarting { answered: None };
                return Ok(None);
            }
        };
        if let Stage::Restarting { answered } = &mut self.stage {
            answered.get_or_insert_with(Instant::now);
        }
        if report.phase == Phase::Armed || matches!(report.booted, Booted::OnTrial | Booted::Unknown) {
            return Ok(None);
        }
        // The new firmware may have other functions.
        session.forget(session.address());
        let now = session.version()?;
        match why_not_started(report.booted, &self.image.version, &now) {
            None => Ok(Some(Progress::Confirmed(now))),
            Some(why) => Err(UpdateError::Failed(why)),
        }
    }
}

const NO_BOOTLOADER: &str = "the hub has no bootloader: flash new firmware through its debug probe";
const NOT_CHECKED: &str =
    "the hub has not finished the check; it checks a signature only while all motors are disabled";
const NOT_ANSWERED: &str = "the hub has not answered since its restart: look at its version once it answers";
const NOT_CONFIRMED: &str =
    "the new firmware has not started, or has not confirmed itself: look at the hub's version";

/// Why an image does not fit the hub's slot; `None` if the image fits.
fn why_unfit(Image { bytes, origin: linked, .. }: &Image, report: &UpdateReport) -> Option<String> {
    let UpdateReport { origin, capacity, .. } = *report;
    if let Some(linked) = linked.filter(|linked| *linked != origin) {
        return Some(format!(
            "the image is linked to {linked:#010x}, but this hub's images begin at {origin:#010x}: build it for the bootloader"
        ));
    }
    if bytes.len() > capacity as usize {
        return Some(format!("the image has {} bytes; the hub's slot holds {capacity}", bytes.len()));
    }
    // The second vector is the address of the first instruction.
    let entry = bytes.get(4..8).and_then(|word| word.try_into().ok()).map_or(0, u32::from_le_bytes);
    (entry.wrapping_sub(origin) >= capacity).then(|| {
        format!(
            "the image's code begins at {entry:#010x}, outside this hub's slot of {origin:#010x} to {:#010x}: \
             the image is for another chip, or not built for the bootloader",
            origin.wrapping_add(capacity)
        )
    })
}

/// Why the hub has failed to write or check the image; `None` if the hub reports no failure.
const fn why_failed(outcome: Outcome) -> Option<&'static str> {
    match outcome {
        Outcome::Mismatch => Some("the hub's flash reads back other bytes than were sent"),
        Outcome::WrongSignature => Some("the signature is not of this file by the hub's key"),
        Outcome::Older => Some("the image is older than the hub's firmware: its rollback version is lower"),
        Outcome::Refused => Some("the hub's flash refused the write"),
        Outcome::None | Outcome::Done => None,
    }
}

/// Why an update to the version `sent` has not succeeded after the restart; `None` if the new firmware runs and has
/// confirmed itself. `now` is the version that the hub reports.
fn why_not_started(booted: Booted, sent: &str, now: &str) -> Option<String> {
    match booted {
        Booted::Reverted => Some(format!(
            "{sent} was refused by the bootloader or did not confirm itself, and the hub returned to the former firmware, {now}"
        )),
        Booted::OnTrial | Booted::Unknown => Some("the new firmware runs, but has not confirmed itself".to_owned()),
        Booted::Unconfirmable => Some(
            "the new firmware runs, but the flash of the hub refuses its confirmation: the next reset restores the firmware before"
                .to_owned(),
        ),
        Booted::Confirmed => (now != sent).then(|| format!("the hub runs {now}, but the image sent is {sent}")),
    }
}

/// True while the hub writes or checks.
const fn is_busy(report: &UpdateReport) -> bool {
    report.is_busy || matches!(report.phase, Phase::Checking | Phase::Disarming)
}

/// Returns the signature in the bytes of a signature file.
///
/// # Errors
/// What is wrong with the file, as the end of a sentence.
pub fn read_signature(file: &[u8]) -> Result<[u8; 64], String> {
    let length = file.len();
    file.try_into().map_err(|_| format!("has {length} bytes; an Ed25519 signature has 64"))
}

/// Returns the public key in the bytes of a key file.
///
/// # Errors
/// What is wrong with the file, as the end of a sentence.
pub fn read_key(file: &[u8]) -> Result<[u8; 32], &'static str> {
    public_key(file)
        .ok_or("is not an Ed25519 public key in DER; make it by openssl pkey -pubout -outform DER")
}

impl Session {
    /// Progress of an update, how the present firmware was started, and the slot's address and size.
    pub fn update_state(&mut self) -> Result<UpdateReport, Error> {
        self.request(HubFunction::Update)
    }
}
