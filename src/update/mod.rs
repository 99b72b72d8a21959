//! Firmware update over the host's link: decides which chunks of an image are accepted, and when the image may start.
//!
//! Firmware runs from the *active slot* of the flash, and [`Slot`] describes the active slot. New firmware is written
//! to the *download slot*, from which no firmware runs.
//!
//! The host announces an image by its length and its CRC-32. The host then sends the image in order, in chunks of
//! [`CHUNK`] bytes, and the hub writes the chunks to the download slot. The hub then reads the download slot back and
//! checks the image. A correct image is *armed*: at the next reset the bootloader swaps the contents of the two slots.
//! If the hub loses its power or its host before the image is armed, the present firmware stays.
//!
//! New firmware is *on trial* until it *confirms* itself. If a reset comes first, the bootloader restores the previous
//! firmware.
//!
//! ```text
//!          begin             finish            image is correct          restart
//! Nothing ---------> Receiving ---------> Checking ---------------> Armed ---------> reset
//!    ^                  |                    |                        |
//!    |                  | flash error,       | image is wrong,        | abandon
//!    |                  v abandon            v flash error, abandon   v
//!    +<-----------------+<-------------------+<------------------ Disarming
//! ```
//!
//! A check that the slot task has begun cannot be stopped. If the host abandons the image during the check and the slot
//! task arms the image, [`Update`] requests the disarming at once.
//!
//! If the hub has the key of a [signer](Slot::signer), the host must send a signature before the first chunk. The hub
//! then arms an image only if its signature is valid, and if the image is not [older](ROLLBACK_VERSION_AT) than the
//! present firmware.
//!
//! [`Update`] accepts or refuses requests, and does not access the flash. The *slot task* (`tasks::update`) owns the
//! flash. It carries out each [`UpdateRequest`] and answers with [`SlotReport`].
//!
//! ```
//! use motor_hub::update::{Booted, CHUNK, SlotReport, UpdateRequest, Outcome, Phase, Slot, Update};
//!
//! let slot = Slot { origin: 0x0802_0000, length: 512 * 1024, ram: (0x2000_0000, 0x2002_0000), signer: None };
//! let mut update = Update::new(slot);
//! update.done(SlotReport::Booted(Booted::Confirmed));
//! // An image begins with its stack pointer, in the RAM, and its reset vector, in the slot.
//! let mut image = [0; CHUNK];
//! image[..8].copy_from_slice(&[0, 0, 2, 0x20, 0x41, 0, 2, 8]);
//!
//! update.begin(image.len() as u32, 0x1234_5678, false)?;
//! update.chunk(0, &image)?;
//! assert!(matches!(update.request(), Some(UpdateRequest::Write { offset: 0, .. })));
//! update.done(SlotReport::Result(Outcome::Done));
//! update.finish()?;
//! assert_eq!(update.request(), Some(UpdateRequest::Arm { length: 96, crc: 0x1234_5678, signature: None }));
//! // The flash reads back other bytes than the host announced.
//! update.done(SlotReport::Result(Outcome::Mismatch));
//! assert_eq!(update.phase(), Phase::Nothing);
//! # Ok::<(), motor_hub::protocol::Nack>(())
//! ```

use crate::protocol::Nack;
use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use heapless::Vec;

/// Algorithm of an image's checksum: the CRC-32 of Ethernet (IEEE 802.3).
pub const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Position in an image of its *rollback version*, a little-endian number: vector 8, which is reserved and 0 on a
/// Cortex-M (ARMv7-M ARM, B1.5.2). A shorter image has version 0. A hub that checks signatures accepts no image with a
/// lower number than the present firmware.
pub const ROLLBACK_VERSION_AT: u32 = 0x20;

/// Length of each chunk except the last, in bytes: a multiple of the longest word that a flash writes, 32 bytes.
pub const CHUNK: usize = 96;

/// The active slot: the part of the flash that images are linked for and run from. An image must fit the active slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// First address of the active slot.
    pub origin: u32,
    /// Length of the active slot in bytes. An image must not be longer.
    pub length: u32,
    /// First address of the RAM that the stack of an image may be in, and the address after its last byte.
    pub ram: (u32, u32),
    /// Public key (Ed25519, RFC 8032) of the signer, whose signature each image must have. `None` if unsigned images
    /// are accepted.
    pub signer: Option<[u8; 32]>,
}

/// The signature of an image, with the public key of its signer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ImageSignature {
    /// The signer's public key (Ed25519, RFC 8032).
    pub key: [u8; 32],
    /// The signer's signature of the image's SHA-512 hash.
    pub bytes: [u8; 64],
}

/// Reads the public key from a file that `openssl pkey -pubout -outform DER` wrote (RFC 8410, section 4).
///
/// Returns `None` if the file does not hold an Ed25519 key.
///
/// ```
/// let mut file = [7; 44];
/// file[..12].copy_from_slice(&[0x30, 0x2A, 0x30, 0x05, 0x06, 0x03, 0x2B, 0x65, 0x70, 0x03, 0x21, 0x00]);
/// assert_eq!(motor_hub::update::public_key(&file), Some([7; 32]));
/// assert_eq!(motor_hub::update::public_key(b"-----BEGIN PUBLIC KEY-----"), None);
/// ```
pub const fn public_key(file: &[u8]) -> Option<[u8; 32]> {
    /// First 12 bytes of the file: a DER header with Ed25519's object identifier, 1.3.101.112. A key of 32 bytes
    /// follows.
    const HEAD: u128 = 0x302A_3005_0603_2B65_7003_2100;
    let (Some(start), Some((_, key))) = (file.first_chunk(), file.split_first_chunk::<12>()) else {
        return None;
    };
    match key.as_array() {
        Some(key) if u128::from_be_bytes(*start) >> 32 == HEAD => Some(*key),
        _ => None,
    }
}

/// State of an update. The documentation of the module has a diagram.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// No update is in progress. The slot task may still check an image that the host has abandoned.
    #[default]
    Nothing,
    /// The hub accepts chunks of an announced image.
    Receiving,
    /// The slot task reads the image back, checks it, and arms it if it is correct.
    Checking,
    /// The next reset starts the image.
    Armed,
    /// The slot task is disarming the image.
    Disarming,
}

/// How the bootloader started the present firmware.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Booted {
    /// The slot task has not read the bootloader's state yet, or the state cannot be read.
    #[default]
    Unknown,
    /// The present firmware is confirmed: every reset starts it again.
    Confirmed,
    /// The present firmware is new and on trial. The next reset restores the previous firmware, unless the present
    /// firmware confirms itself first.
    OnTrial,
    /// The present firmware was started instead of new firmware, which did not confirm itself or which the bootloader
    /// refused.
    Reverted,
    /// The present firmware is new and runs, but its confirmation cannot be written to the flash. The next reset
    /// restores the previous firmware.
    Unconfirmable,
}

/// Result of the last request that the slot task carried out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// No request has been carried out since boot, or since an image was announced.
    #[default]
    None,
    /// The request was carried out.
    Done,
    /// The flash reported an error, or the chip did not restart.
    Refused,
    /// The CRC-32 that the flash reads back differs from the announced CRC-32.
    Mismatch,
    /// The signature is not valid for this image.
    WrongSignature,
    /// The image is signed, and its [rollback version](ROLLBACK_VERSION_AT) is lower than the rollback version of the
    /// present firmware.
    Older,
}

/// A request to the slot task.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UpdateRequest {
    /// Write a chunk to the download slot. If the chunk contains the first byte of a flash page, erase this page first.
    Write {
        /// Distance of the chunk from the beginning of the image, in bytes.
        offset: u32,
        /// Bytes of the chunk.
        bytes: Vec<u8, CHUNK>,
    },
    /// Check the image in the download slot. If its CRC-32 and its signature are correct, let the next reset start the
    /// image.
    Arm {
        /// Length of the image in bytes.
        length: u32,
        /// CRC-32 that the host announced.
        crc: u32,
        /// Signature of the image; `None` on a hub that accepts unsigned images.
        signature: Option<ImageSignature>,
    },
    /// Let the next reset start the present firmware again, not the armed image.
    Disarm,
    /// Reset the chip.
    Restart,
}

/// A report of the slot task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlotReport {
    /// How the present firmware was started. The slot task sends this report at boot, and again after the confirmation.
    Booted(Booted),
    /// Result of the last request.
    Result(Outcome),
}

/// The refusal of a chunk with a wrong length. The last chunk must have the rest of the image, and each other chunk
/// [`CHUNK`] bytes.
const CHUNK_LENGTH: Nack = Nack::parameter(1);

/// State machine of firmware updates. The documentation of the module has a diagram.
#[derive(Clone, Debug)]
pub struct Update {
    slot: Slot,
    booted: Booted,
    phase: Phase,
    /// Announced length of the image in bytes.
    length: u32,
    /// Announced CRC-32 of the image.
    crc: u32,
    /// Number of bytes of the image that were accepted so far.
    received: u32,
    /// Signature of the announced image. `None` until the host sends a signature.
    signature: Option<ImageSignature>,
    /// Result of the last request.
    outcome: Outcome,
    task: TaskState,
}

/// What the slot task does.
///
/// ```text
/// Idle ── request ──▶ Requested ── the task takes the request ──▶ Busy ── result ──▶ Idle
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
enum TaskState {
    /// There is no request.
    Idle,
    /// The slot task has not taken this request yet.
    Requested(UpdateRequest),
    /// The slot task carries out a request.
    Busy,
}

impl Update {
    /// Creates the state after a reset. All images are refused until the slot task reports how the present firmware was
    /// started.
    pub const fn new(slot: Slot) -> Self {
        Self {
            slot,
            booted: Booted::Unknown,
            phase: Phase::Nothing,
            length: 0,
            crc: 0,
            received: 0,
            signature: None,
            outcome: Outcome::None,
            task: TaskState::Idle,
        }
    }

    /// Announces an image of `length` bytes with this CRC-32 (IEEE 802.3). Chunks of an earlier image are discarded.
    ///
    /// # Errors
    /// Returns a [`Nack`] if a motor runs, the slot task is busy, an image is armed, or the image does not fit the
    /// active slot. Also returns a [`Nack`] while the present firmware is on trial, or if its confirmation is not known
    /// or has failed.
    pub fn begin(&mut self, length: u32, crc: u32, motors_run: bool) -> Result<(), Nack> {
        if motors_run {
            return Err(Nack::MOTOR_ENABLED);
        }
        if matches!(self.booted, Booted::Unknown | Booted::OnTrial | Booted::Unconfirmable) {
            return Err(Nack::UPDATE_ON_TRIAL);
        }
        self.check_idle()?;
        if self.phase == Phase::Armed {
            return Err(Nack::UPDATE_ARMED);
        }
        if length < VECTORS || length > self.slot.length {
            return Err(Nack::UPDATE_TOO_LONG);
        }
        (self.phase, self.outcome) = (Phase::Receiving, Outcome::None);
        (self.length, self.crc, self.received, self.signature) = (length, crc, 0, None);
        Ok(())
    }

    /// Stores the signature of the announced image. The signature is verified when the whole image is in the download
    /// slot.
    ///
    /// # Errors
    /// Returns a [`Nack`] if the hub has no key, if no image is announced, or if the signature has another key than the
    /// hub.
    pub fn sign(&mut self, signature: ImageSignature) -> Result<(), Nack> {
        let signer = self.slot.signer.ok_or(Nack::UPDATE_NO_SIGNER)?;
        if self.phase != Phase::Receiving {
            return Err(Nack::UPDATE_NOT_BEGUN);
        }
        if signature.key != signer {
            return Err(Nack::UPDATE_OTHER_KEY);
        }
        self.signature = Some(signature);
        Ok(())
    }

    /// Accepts the next chunk. A chunk that was accepted before may be repeated without effect, because the host may
    /// not have received the answer.
    ///
    /// # Errors
    /// Returns a [`Nack`] if the chunk is not the next chunk, has a wrong length, or comes while the slot task is busy.
    /// Refuses a first chunk that is not the beginning of an image for this hub, and all chunks while a required
    /// signature is missing.
    pub fn chunk(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Nack> {
        if self.phase != Phase::Receiving {
            return Err(Nack::UPDATE_NOT_BEGUN);
        }
        if self.slot.signer.is_some() && self.signature.is_none() {
            return Err(Nack::UPDATE_UNSIGNED);
        }
        if offset < self.received && offset.is_multiple_of(CHUNK as u32) {
            return Ok(());
        }
        if offset != self.received {
            return Err(Nack::UPDATE_GAP);
        }
        let left = self.length.saturating_sub(offset);
        if bytes.is_empty() || bytes.len() as u32 != left.min(CHUNK as u32) {
            return Err(CHUNK_LENGTH);
        }
        if offset == 0 && !self.slot.accepts(bytes) {
            return Err(Nack::UPDATE_NOT_AN_IMAGE);
        }
        self.check_idle()?;
        let bytes = Vec::from_slice(bytes).map_err(|_| CHUNK_LENGTH)?;
        self.received += bytes.len() as u32;
        self.task = TaskState::Requested(UpdateRequest::Write { offset, bytes });
        Ok(())
    }

    /// Ends the transfer: the slot task then checks the image and arms it. A repeated call changes nothing.
    ///
    /// # Errors
    /// Returns a [`Nack`] if no image is announced, if chunks are missing, or if the slot task is busy.
    pub fn finish(&mut self) -> Result<(), Nack> {
        match self.phase {
            Phase::Checking | Phase::Armed => return Ok(()),
            Phase::Receiving => (),
            Phase::Nothing | Phase::Disarming => return Err(Nack::UPDATE_NOT_BEGUN),
        }
        if self.received < self.length {
            return Err(Nack::UPDATE_GAP);
        }
        self.check_idle()?;
        self.phase = Phase::Checking;
        self.task = TaskState::Requested(UpdateRequest::Arm {
            length: self.length,
            crc: self.crc,
            signature: self.signature,
        });
        Ok(())
    }

    /// Requests a reset of the chip, after which the bootloader starts the armed image. A repeated call changes
    /// nothing.
    ///
    /// # Errors
    /// Returns a [`Nack`] if no image is armed, or if a motor runs.
    pub fn restart(&mut self, motors_run: bool) -> Result<(), Nack> {
        if self.phase != Phase::Armed {
            return Err(Nack::UPDATE_NOT_ARMED);
        }
        if motors_run {
            return Err(Nack::MOTOR_ENABLED);
        }
        if !self.is_busy() {
            self.task = TaskState::Requested(UpdateRequest::Restart);
        }
        Ok(())
    }

    /// Discards the announced image. If the image is armed, requests its disarming. If the slot task is checking the
    /// image, and arms it afterwards, [`done`](Self::done) requests its disarming. A repeated call changes nothing.
    ///
    /// # Errors
    /// Returns [`Nack::UPDATE_BUSY`] while the slot task writes a chunk, or restarts the chip.
    pub fn abandon(&mut self) -> Result<(), Nack> {
        match self.phase {
            Phase::Disarming => return Ok(()),
            // The slot task ends a check that it has begun.
            Phase::Nothing | Phase::Checking if self.task == TaskState::Busy => (),
            Phase::Nothing | Phase::Checking => self.task = TaskState::Idle,
            Phase::Receiving | Phase::Armed => self.check_idle()?,
        }
        self.phase = if self.phase == Phase::Armed { self.disarm() } else { Phase::Nothing };
        Ok(())
    }

    /// Requests the disarming of the image. Returns the new phase.
    fn disarm(&mut self) -> Phase {
        self.task = TaskState::Requested(UpdateRequest::Disarm);
        Phase::Disarming
    }

    /// Hands the pending request to the slot task. `None` if no request is pending, or while the task carries out
    /// another request.
    ///
    /// The task must report the result to [`done`](Self::done).
    pub fn request(&mut self) -> Option<UpdateRequest> {
        match core::mem::replace(&mut self.task, TaskState::Busy) {
            TaskState::Requested(request) => Some(request),
            other => {
                self.task = other;
                None
            }
        }
    }

    /// Processes a report of the slot task.
    pub fn done(&mut self, report: SlotReport) {
        let outcome = match report {
            SlotReport::Booted(booted) => {
                self.booted = booted;
                return;
            }
            SlotReport::Result(outcome) => outcome,
        };
        (self.task, self.outcome) = (TaskState::Idle, outcome);
        self.phase = match (self.phase, outcome) {
            (Phase::Checking, Outcome::Done) => Phase::Armed,
            // The host has abandoned the image during its check, but the slot task has armed the image.
            (Phase::Nothing, Outcome::Done) => self.disarm(),
            (Phase::Receiving, Outcome::Done) => Phase::Receiving,
            // After a failed restart or a failed disarming the image is still armed.
            (Phase::Armed, _) | (Phase::Disarming, Outcome::Refused) => Phase::Armed,
            _ => Phase::Nothing,
        };
    }

    /// Returns the state of the update.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// Returns how the present firmware was started.
    pub const fn booted(&self) -> Booted {
        self.booted
    }

    /// Returns the result of the last request.
    pub const fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Returns true while the slot task carries out a request, or a request waits for the task.
    pub fn is_busy(&self) -> bool {
        self.task != TaskState::Idle
    }

    /// Returns the number of accepted bytes of the image, and the announced length of the image in bytes.
    pub const fn progress(&self) -> (u32, u32) {
        (self.received, self.length)
    }

    /// Returns the active slot, which images are linked for.
    pub const fn slot(&self) -> Slot {
        self.slot
    }

    /// Refuses if the slot task carries out a request, or if a request waits for the task.
    fn check_idle(&self) -> Result<(), Nack> {
        if self.is_busy() { Err(Nack::UPDATE_BUSY) } else { Ok(()) }
    }
}

/// Length in bytes of the two vectors at the beginning of an image: initial stack pointer and reset vector.
const VECTORS: u32 = 8;

impl Slot {
    /// Returns true if the first two vectors of `image` fit this chip and the active slot (ARMv7-M ARM, B1.5.3).
    ///
    /// The initial stack pointer must be in the RAM or at its end, and a multiple of 8. The reset vector must be in the
    /// slot and odd, because its lowest bit selects Thumb code.
    fn accepts(&self, image: &[u8]) -> bool {
        let Some((stack, rest)) = image.split_first_chunk() else { return false };
        let Some((reset, _)) = rest.split_first_chunk() else { return false };
        let (stack, reset) = (u32::from_le_bytes(*stack), u32::from_le_bytes(*reset));
        let in_ram = stack > self.ram.0 && stack <= self.ram.1 && stack.is_multiple_of(8);
        let in_slot = reset.wrapping_sub(self.origin) < self.length && !reset.is_multiple_of(2);
        in_ram && in_slot
    }
}
