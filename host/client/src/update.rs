//! New firmware, sent to a hub that has a bootloader, and started.
//!
//! ```
//! use motor_hub_client::motor_hub::protocol::Address;
//! use motor_hub_client::{Error, Session, memory::MemoryHub};
//! use std::time::Duration;
//!
//! let mut session = Session::new(MemoryHub::default(), Address::DEFAULT, Duration::from_secs(1));
//! // It has none.
//! let refused = session.update_state().unwrap_err().to_string();
//! assert_eq!(refused, "the hub refuses to tell how far its update is: this hub does not have it (NACK 253)");
//! ```

use crate::{Error, Session};
use motor_hub::protocol::Nack;
use motor_hub::protocol::fields::{TEXT, Text};
use motor_hub::protocol::update::{ToUpdate, UpdateReport};
use motor_hub::update::{CHUNK, CRC, Phase, Seal};
use std::io::{Read, Write};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A page is erased within 4 s, and the bootloader's state too.
const WRITING: Duration = Duration::from_secs(10);

/// A control period is 100 ms at most, for motors that have just been disabled.
const STOPPING: Duration = Duration::from_millis(300);

const POLL: Duration = Duration::from_millis(20);

impl<L: Read + Write> Session<L> {
    /// How far an update is, how the firmware that runs was started, and where images go.
    ///
    /// # Errors
    /// See [`Session::ask`], as for all commands.
    pub fn update_state(&mut self) -> Result<UpdateReport, Error> {
        self.ask(ToUpdate::State)
    }

    /// Sends the bytes of an image, and has them checked and armed: the report says how that ended. The version is what
    /// the hub tells of it meanwhile. A hub that was built with a signer's key wants that one's seal of the image, and one
    /// without refuses any. `progress` is told the bytes that were sent, and stops it with an error of its own;
    /// what was sent is then abandoned, as on any error.
    ///
    /// # Errors
    /// As those of all commands, or `progress`'s.
    pub fn send_image<E: From<Error>>(
        &mut self,
        image: &[u8],
        version: &str,
        seal: Option<Seal>,
        progress: impl FnMut(usize) -> Result<(), E>,
    ) -> Result<UpdateReport, E> {
        let sent = self.send_chunks(image, version, seal, progress);
        if sent.is_err() {
            // It is forgotten at the next reset at the latest.
            let _ = self.abandon_update();
        }
        sent
    }

    /// Restarts the hub with the image that is armed; a motor that is enabled is in the way.
    ///
    /// # Errors
    /// As those of all commands.
    pub fn restart(&mut self) -> Result<(), Error> {
        self.persist(&ToUpdate::Restart, Nack::MOTOR_ENABLED, STOPPING)
    }

    /// Has the hub forget an image, one that is armed too.
    ///
    /// # Errors
    /// As those of all commands.
    pub fn abandon_update(&mut self) -> Result<UpdateReport, Error> {
        self.persist(&ToUpdate::Abandon, Nack::UPDATE_AT_WORK, WRITING)?;
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
        let version = Text::new(bytes.get(..TEXT).unwrap_or(bytes)).unwrap_or_default();
        let begin = ToUpdate::Begin { length, crc: CRC.checksum(image), version };
        self.persist(&begin, Nack::MOTOR_ENABLED, STOPPING)?;
        if let Some(Seal { key, signature }) = seal {
            self.order(ToUpdate::Sign { key, signature })?;
        }
        for (index, chunk) in image.chunks(CHUNK).enumerate() {
            progress(index * CHUNK)?;
            let offset = u32::try_from(index * CHUNK).unwrap_or(u32::MAX);
            let bytes = Text::new(chunk).unwrap_or_default();
            self.persist(&ToUpdate::Chunk { offset, bytes }, Nack::UPDATE_AT_WORK, WRITING)?;
        }
        progress(image.len())?;
        self.persist(&ToUpdate::Finish, Nack::UPDATE_AT_WORK, WRITING)?;
        Ok(self.update_settled()?)
    }

    /// Says it until it is not refused for this reason, or for so long.
    fn persist(&mut self, request: &ToUpdate, unless: Nack, limit: Duration) -> Result<(), Error> {
        let end = Instant::now() + limit;
        loop {
            match self.order(request.clone()) {
                Err(Error::Refused { reason, .. }) if reason == unless && Instant::now() < end => sleep(POLL),
                done => return done,
            }
        }
    }

    /// Waits until nothing is written or checked any more.
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
