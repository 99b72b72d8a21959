//! Sends new firmware to a hub with a bootloader, and starts it.
//!
//! ```
//! use motor_hub_client::motor_hub::protocol::Address;
//! use motor_hub_client::{Error, Session, memory::MemoryHub};
//! use std::time::Duration;
//!
//! let mut session = Session::new(MemoryHub::default(), Address::DEFAULT, Duration::from_secs(1));
//! // The hub in memory has no bootloader.
//! let refused = session.update_state().unwrap_err().to_string();
//! assert_eq!(refused, "the hub refuses to report its update: this hub does not have it (NACK 253)");
//! ```

use crate::clock::Instant;
use crate::{Error, Session};
use motor_hub::extension::HubFunction;
use motor_hub::extension::state::UpdateReport;
use motor_hub::protocol::Nack;
use motor_hub::protocol::payload::{TEXT, Text};
use motor_hub::update::{CHUNK, CRC, Phase, Seal, public_key};
use std::io::{Read, Write};
use std::thread::sleep;
use std::time::Duration;

/// Time-out of a write: erasing a page takes up to 4 s, erasing the bootloader's state another 4 s.
const WRITING: Duration = Duration::from_secs(10);

/// Interval between two questions to a hub that is busy.
const POLL: Duration = Duration::from_millis(20);

/// The signature in the bytes of a signature file.
///
/// # Errors
/// What is wrong with the file, as the end of a sentence.
pub fn read_signature(file: &[u8]) -> Result<[u8; 64], String> {
    let length = file.len();
    file.try_into().map_err(|_| format!("has {length} bytes; an Ed25519 signature has 64"))
}

/// The public key in the bytes of a key file.
///
/// # Errors
/// What is wrong with the file, as the end of a sentence.
pub fn read_key(file: &[u8]) -> Result<[u8; 32], &'static str> {
    public_key(file)
        .ok_or("is not an Ed25519 public key in DER; make it by openssl pkey -pubout -outform DER")
}

impl<L: Read + Write> Session<L> {
    /// Progress of an update, how the present firmware was started, and the slot's address and size.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn update_state(&mut self) -> Result<UpdateReport, Error> {
        self.ask(HubFunction::Update)
    }

    /// Sends the bytes of an image; the hub then checks and arms the image. The report says with what result.
    ///
    /// The hub reports `version` until the update is finished. A hub that was built with a public key accepts only an
    /// image with a `seal` by that key. A hub without a key refuses any seal. `progress` receives the number of bytes sent
    /// so far; an error of `progress` ends the transfer. On any error the hub forgets the image.
    ///
    /// # Errors
    /// The errors of all commands, or the error of `progress`.
    pub fn send_image<E: From<Error>>(
        &mut self,
        image: &[u8],
        version: &str,
        seal: Option<Seal>,
        progress: impl FnMut(usize) -> Result<(), E>,
    ) -> Result<UpdateReport, E> {
        let sent = self.send_chunks(image, version, seal, progress);
        if sent.is_err() {
            // Should this fail too, the hub forgets the image at its next reset.
            let _ = self.abandon_update();
        }
        sent
    }

    /// Restarts the hub with the armed image. All motors must be disabled.
    ///
    /// # Errors
    /// The errors of all commands.
    pub fn restart(&mut self) -> Result<(), Error> {
        // The hub judges by its last control tick whether motors are disabled.
        self.catch_up()?;
        self.order(HubFunction::Restart)
    }

    /// Makes the hub forget an image, even an armed one.
    ///
    /// # Errors
    /// The errors of all commands.
    pub fn abandon_update(&mut self) -> Result<UpdateReport, Error> {
        self.persist(&HubFunction::AbandonUpdate)?;
        self.update_settled()
    }

    fn send_chunks<E: From<Error>>(
        &mut self,
        image: &[u8],
        version: &str,
        seal: Option<Seal>,
        mut progress: impl FnMut(usize) -> Result<(), E>,
    ) -> Result<UpdateReport, E> {
        let length = u32::try_from(image.len()).unwrap_or(u32::MAX);
        let bytes = version.as_bytes();
        let version = Text::from_slice(bytes.get(..TEXT).unwrap_or(bytes)).unwrap_or_default();
        let begin = HubFunction::BeginUpdate { length, crc: CRC.checksum(image), version };
        self.catch_up()?;
        self.order(begin)?;
        if let Some(Seal { key, signature }) = seal {
            self.order(HubFunction::Sign { key, signature })?;
        }
        for (index, chunk) in image.chunks(CHUNK).enumerate() {
            progress(index * CHUNK)?;
            let offset = u32::try_from(index * CHUNK).unwrap_or(u32::MAX);
            let bytes = Text::from_slice(chunk).unwrap_or_default();
            self.persist(&HubFunction::Chunk { offset, bytes })?;
        }
        progress(image.len())?;
        self.persist(&HubFunction::FinishUpdate)?;
        Ok(self.update_settled()?)
    }

    /// Repeats a request while the hub refuses it because it still writes.
    fn persist(&mut self, request: &HubFunction) -> Result<(), Error> {
        let end = Instant::now() + WRITING;
        loop {
            match self.order(request.clone()) {
                Err(Error::Refused { reason: Nack::UPDATE_BUSY, .. }) if Instant::now() < end => sleep(POLL),
                done => return done,
            }
        }
    }

    /// Waits until the hub neither writes nor checks.
    fn update_settled(&mut self) -> Result<UpdateReport, Error> {
        let end = Instant::now() + WRITING;
        loop {
            let report = self.update_state()?;
            let settled = !report.at_work && !matches!(report.phase, Phase::Checking | Phase::Disarming);
            if settled || Instant::now() > end {
                return Ok(report);
            }
            sleep(POLL);
        }
    }
}
