//! New firmware for a hub with a bootloader. A page sends the image in parts. The relay passes the image on in small chunks
//! between frames, so that pages see the hub all the time.
//!
//! ```text
//! collected --begin--> sending --finish--> checking --restart--> restarting --> confirmed, or why not
//! ```

use crate::hub::{Hub, RequestError};
use crate::requests::SealFiles;
use motor_hub::extension::HubFunction;
use motor_hub::protocol::Nack;
use motor_hub::protocol::payload::{TEXT, Text};
use motor_hub::update::{Booted, CHUNK, CRC, Phase, Seal, public_key};
use motor_hub_client::Error;
use motor_hub_client::clock::Instant;
use motor_hub_client::reasons::{why_not_armed, why_not_started, why_unfit};
use serde::Serialize;
use std::time::Duration;

/// Largest image in bytes: more than the flash of any supported chip.
pub(crate) const LARGEST: usize = 4 << 20;

/// Chunks that are sent between two frames: some 20 kB/s, of the 46 kB/s of a serial line.
const CHUNKS: usize = 4;

/// Time-out of a write or check in the hub: erasing a page takes up to 4 s, erasing the bootloader's state another 4 s.
const WRITING: Duration = Duration::from_secs(10);

/// Time-out for the hub to answer after the restart, and to confirm its firmware: it swaps slots, and may swap back.
const RETURNING: Duration = Duration::from_secs(105);

/// Progress of an update, for pages.
#[derive(Clone, Debug, Serialize)]
pub(crate) struct Progress {
    /// `running`, `done` or `failed`.
    pub(crate) state: &'static str,
    /// Bytes that the hub has, as a share, 0 to 100.
    pub(crate) percent: usize,
    /// What happens now, or what came of it.
    pub(crate) text: String,
}

/// A running update.
#[derive(Debug)]
pub(crate) struct Update {
    image: Vec<u8>,
    version: String,
    stage: Stage,
    /// Time of the last progress.
    since: Instant,
}

#[derive(Debug, PartialEq, Eq)]
enum Stage {
    /// The hub has this many bytes.
    Sending(usize),
    /// The hub checks the image.
    Checking,
    /// The hub swaps its firmware, and does not answer meanwhile.
    Restarting,
}

impl Update {
    /// Announces an image to the hub. All motors must be disabled.
    pub(crate) fn begin(
        session: &mut Hub,
        image: Vec<u8>,
        version: &str,
        files: Option<&SealFiles>,
    ) -> Result<Self, RequestError> {
        let seal = files.map(seal).transpose()?;
        let report = session.update_state().map_err(|error| match error {
            Error::Refused { reason: Nack::UNSUPPORTED | Nack::UNKNOWN, .. } | Error::TooOld { .. } => {
                RequestError::from("the hub has no bootloader: flash new firmware through its debug probe")
            }
            error => error.into(),
        })?;
        if let Some(why) = why_unfit(&image, &report) {
            return Err(why.into());
        }
        if report.phase == Phase::Armed {
            session.order(HubFunction::AbandonUpdate)?;
            return Err("an earlier update waited for a restart, and is abandoned: try again".into());
        }
        let bytes = version.as_bytes();
        let announced = Text::from_slice(bytes.get(..TEXT).unwrap_or(bytes)).unwrap_or_default();
        let length = u32::try_from(image.len()).unwrap_or(u32::MAX);
        session.catch_up()?;
        session.order(HubFunction::BeginUpdate { length, crc: CRC.checksum(&image), version: announced })?;
        if let Some(Seal { key, signature }) = seal
            && let Err(error) = session.order(HubFunction::Sign { key, signature })
        {
            abandon(session);
            return Err(error.into());
        }
        let (version, stage) = (version.to_owned(), Stage::Sending(0));
        Ok(Self { image, version, stage, since: Instant::now() })
    }

    /// True while the hub may be silent because it restarts.
    pub(crate) fn restarts(&self) -> bool {
        self.stage == Stage::Restarting
    }

    /// Continues. Returns the progress where there is news; after `done` or `failed` the update has ended.
    pub(crate) fn go_on(&mut self, session: &mut Hub) -> Result<Option<Progress>, Error> {
        let done = match self.stage {
            Stage::Sending(at) => self.send(session, at),
            Stage::Checking => self.check(session),
            Stage::Restarting => self.returned(session),
        };
        match done {
            Ok(None) => Ok(self.late()),
            Ok(progress) => {
                self.since = Instant::now();
                Ok(progress)
            }
            // A hub that starts may answer with garbage.
            Err(RequestError::Refused(_)) if self.restarts() => Ok(self.late()),
            Err(RequestError::Refused(why)) => {
                abandon(session);
                Ok(Some(self.progress("failed", why)))
            }
            Err(RequestError::Hub(error)) => Err(error),
        }
    }

    /// A failure if nothing has happened for too long.
    pub(crate) fn late(&self) -> Option<Progress> {
        let longest = if self.restarts() { RETURNING } else { WRITING };
        (self.since.elapsed() > longest).then(|| {
            let why = match self.stage {
                Stage::Sending(_) => "the hub has not finished a write",
                Stage::Checking => "the hub has not finished the check",
                Stage::Restarting => "the hub has not confirmed the new firmware: look at its version",
            };
            self.failed(why)
        })
    }

    /// The end of an update that cannot go on.
    pub(crate) fn failed(&self, why: &str) -> Progress {
        self.progress("failed", why.to_owned())
    }

    fn progress(&self, state: &'static str, text: String) -> Progress {
        let percent = match self.stage {
            Stage::Sending(at) => 100 * at / self.image.len().max(1),
            Stage::Checking | Stage::Restarting => 100,
        };
        Progress { state, percent, text }
    }

    fn running(&self, text: &str) -> Option<Progress> {
        Some(self.progress("running", text.to_owned()))
    }

    fn send(&mut self, session: &mut Hub, from: usize) -> Result<Option<Progress>, RequestError> {
        let mut at = from;
        for _ in 0..CHUNKS {
            let rest = self.image.get(at..).unwrap_or_default();
            let chunk = rest.get(..CHUNK).unwrap_or(rest);
            let request = if chunk.is_empty() {
                HubFunction::FinishUpdate
            } else {
                let offset = u32::try_from(at).unwrap_or(u32::MAX);
                HubFunction::Chunk { offset, bytes: Text::from_slice(chunk).unwrap_or_default() }
            };
            match session.order(request) {
                // The hub still writes.
                Err(Error::Refused { reason: Nack::UPDATE_BUSY, .. }) => break,
                sent => sent?,
            }
            if chunk.is_empty() {
                self.stage = Stage::Checking;
                return Ok(self.running("The hub checks the firmware."));
            }
            at += chunk.len();
        }
        self.stage = Stage::Sending(at);
        Ok(if at > from { self.running("The firmware is sent.") } else { None })
    }

    fn check(&mut self, session: &mut Hub) -> Result<Option<Progress>, RequestError> {
        let report = session.update_state()?;
        if report.at_work || matches!(report.phase, Phase::Checking | Phase::Disarming) {
            return Ok(None);
        }
        if let Some(why) = why_not_armed(&report) {
            return Err(why.into());
        }
        session.order(HubFunction::Restart)?;
        self.stage = Stage::Restarting;
        Ok(self.running("The hub restarts with the new firmware, which takes some 20 s."))
    }

    fn returned(&self, session: &mut Hub) -> Result<Option<Progress>, RequestError> {
        let report = session.update_state()?;
        if report.phase == Phase::Armed || matches!(report.booted, Booted::OnTrial | Booted::Unknown) {
            return Ok(None);
        }
        let now = session.version()?;
        Ok(Some(match why_not_started(report.booted, &self.version, &now) {
            None => self.progress("done", format!("the hub runs {now}, confirmed")),
            Some(why) => self.failed(&why),
        }))
    }
}

/// Makes the hub forget an image. Should this fail, the hub forgets the image at its next reset.
fn abandon(session: &mut Hub) {
    let _ = session.order(HubFunction::AbandonUpdate);
}

/// Bytes of hexadecimal digits.
pub(crate) fn bytes_of(hex: &str) -> Option<Vec<u8>> {
    let pairs = hex.as_bytes().chunks(2);
    pairs.map(|pair| u8::from_str_radix(str::from_utf8(pair).ok()?, 16).ok()).collect()
}

/// The signature and the key of two files.
fn seal(files: &SealFiles) -> Result<Seal, String> {
    let (signature, key) = (bytes_of(&files.signature), bytes_of(&files.key));
    let signature = signature.unwrap_or_default();
    let length = signature.len();
    let signature = signature
        .try_into()
        .map_err(|_| format!("the signature has {length} bytes; an Ed25519 signature has 64"))?;
    let key = public_key(&key.unwrap_or_default())
        .ok_or("the key is not an Ed25519 public key in DER; make it by openssl pkey -pubout -outform DER")?;
    Ok(Seal { key, signature })
}
