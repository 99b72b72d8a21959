//! New firmware, sent over the host's line: which pieces of an image are taken, and when it may be started.
//!
//! An image is announced by its length and its CRC-32, sent in chunks of [`CHUNK`] bytes in their order, written to a slot of
//! the flash that nothing runs from, and checked by what the flash reads back. Only then is it armed: a bootloader swaps it in
//! at the next reset. Until then a hub that loses power, or its host, goes on with the firmware that it has.
//!
//! A hub that knows a [signer](Slot::signer) takes no chunk before it was told that one's signature, and arms nothing that
//! it does not fit.
//!
//! ```
//! use motor_hub::update::{Booted, CHUNK, Done, Order, Outcome, Phase, Slot, Update};
//!
//! let slot = Slot { origin: 0x0802_0000, length: 512 * 1024, ram: (0x2000_0000, 0x2002_0000), signer: None };
//! let mut update = Update::new(slot);
//! update.done(Done::Booted(Booted::Confirmed));
//! // A stack in the RAM, and code in the slot: the first bytes of an image.
//! let mut image = [0; CHUNK];
//! image[..8].copy_from_slice(&[0, 0, 2, 0x20, 0x41, 0, 2, 8]);
//!
//! update.begin(image.len() as u32, 0x1234_5678, false)?;
//! update.chunk(0, &image)?;
//! assert!(matches!(update.order(), Some(Order::Write { offset: 0, .. })));
//! update.done(Done::Carried(Outcome::Done));
//! update.finish()?;
//! assert_eq!(update.order(), Some(Order::Arm { length: 96, crc: 0x1234_5678, seal: None }));
//! // The flash reads back something else.
//! update.done(Done::Carried(Outcome::Mismatch));
//! assert_eq!(update.phase(), Phase::Nothing);
//! # Ok::<(), motor_hub::update::Refusal>(())
//! ```

use crc::{CRC_32_ISO_HDLC, Crc, NoTable};
use heapless::Vec;

/// The checksum of an image: CRC-32 as of Ethernet (IEEE 802.3).
pub const CRC: Crc<u32, NoTable> = Crc::<u32, NoTable>::new(&CRC_32_ISO_HDLC);

/// Bytes of each chunk but the last: three of the longest words of a flash.
pub const CHUNK: usize = 96;

/// Where images are linked to, and what their stack may be in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// First address.
    pub origin: u32,
    /// Bytes.
    pub length: u32,
    /// First address of the RAM, and the one behind it.
    pub ram: (u32, u32),
    /// Whose signature images must have: a public key of Ed25519 (RFC 8032). `None` where any image is taken.
    pub signer: Option<[u8; 32]>,
}

/// What says whose an image is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Seal {
    /// The signer's public key (Ed25519, RFC 8032).
    pub key: [u8; 32],
    /// Its signature of the image's SHA-512.
    pub signature: [u8; 64],
}

/// The public key in a file as `openssl pkey -pubout -outform DER` writes it, if it is one of Ed25519 (RFC 8410, section 4).
///
/// ```
/// let mut file = [7; 44];
/// file[..12].copy_from_slice(&[0x30, 0x2A, 0x30, 0x05, 0x06, 0x03, 0x2B, 0x65, 0x70, 0x03, 0x21, 0x00]);
/// assert_eq!(motor_hub::update::public_key(&file), Some([7; 32]));
/// assert_eq!(motor_hub::update::public_key(b"-----BEGIN PUBLIC KEY-----"), None);
/// ```
pub const fn public_key(file: &[u8]) -> Option<[u8; 32]> {
    /// A sequence of the algorithm's number, 1.3.101.112, and a string of 32 bytes.
    const HEAD: u128 = 0x302A_3005_0603_2B65_7003_2100;
    let (Some(start), Some((_, key))) = (file.first_chunk(), file.split_first_chunk::<12>()) else {
        return None;
    };
    match key.as_array() {
        Some(key) if u128::from_be_bytes(*start) >> 32 == HEAD => Some(*key),
        _ => None,
    }
}

/// How far an update is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Phase {
    /// There is none.
    #[default]
    Nothing,
    /// Chunks are being taken.
    Receiving,
    /// What the flash reads back is being checked, and the image armed.
    Checking,
    /// It is started by the next reset.
    Armed,
    /// It is being disarmed.
    Disarming,
}

/// How the firmware that runs was started.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Booted {
    /// That is not known yet.
    #[default]
    Unknown,
    /// It is to stay.
    Confirmed,
    /// It is new, and the next reset goes back to the one before, unless it is confirmed.
    OnTrial,
    /// A newer one did not confirm itself, and this is the one before.
    WentBack,
}

/// What became of an order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// There was none since boot.
    #[default]
    None,
    /// It was carried out.
    Done,
    /// The flash refused.
    Refused,
    /// The flash reads back something else than was announced.
    Mismatch,
    /// The signature is not one of this image.
    WrongSignature,
}

/// Something for whoever has the slot to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// Write this, and erase each page at its begin.
    Write {
        /// From the slot's begin.
        offset: u32,
        /// A chunk.
        bytes: Vec<u8, CHUNK>,
    },
    /// Let the next reset start the image, if it has this CRC-32, and this seal is its.
    Arm {
        /// Of the image, bytes.
        length: u32,
        /// As announced.
        crc: u32,
        /// Where it must have one.
        seal: Option<Seal>,
    },
    /// Let it not.
    Disarm,
    /// Reset.
    Restart,
}

/// What whoever has the slot says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Done {
    /// How the firmware was started; said again when that has changed.
    Booted(Booted),
    /// What became of the order.
    Carried(Outcome),
}

/// Why something was not taken; nothing has changed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Refusal {
    /// While a motor is enabled.
    MotorEnabled,
    /// The last chunk is still being written, or the image checked.
    AtWork,
    /// The firmware that runs is not confirmed, and the slot has the one before.
    OnTrial,
    /// An image is armed.
    Armed,
    /// None is.
    NotArmed,
    /// Nothing was announced, or the flash has refused a chunk.
    NotBegun,
    /// The image is longer than the slot, or empty.
    Length,
    /// A chunk is missing before this one.
    Gap,
    /// The chunk has not [`CHUNK`] bytes, or what is left of the image.
    ChunkLength,
    /// Its vectors do not point into this chip's RAM and into the slot.
    NotAnImage,
    /// The image must be signed, and no signature was sent.
    Unsigned,
    /// The signature is by another key.
    OtherKey,
    /// Signatures mean nothing here.
    NoSigner,
}

impl core::fmt::Display for Refusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::MotorEnabled => "a motor is enabled",
            Self::AtWork => "the hub is still writing or checking",
            Self::OnTrial => "the firmware that runs is not confirmed yet",
            Self::Armed => "an image waits for a restart",
            Self::NotArmed => "no image waits for a restart",
            Self::NotBegun => "no update has begun, or the flash has failed",
            Self::Length => "the image is longer than its slot, or empty",
            Self::Gap => "a chunk is missing before this one",
            Self::ChunkLength => "the chunk is too short or too long",
            Self::NotAnImage => "not an image for this hub",
            Self::Unsigned => "the image must be signed",
            Self::OtherKey => "the signature is by another key than the hub's",
            Self::NoSigner => "the hub was built without a key, and checks no signatures",
        })
    }
}

impl core::error::Error for Refusal {}

/// An update, or none.
#[derive(Clone, Debug)]
pub struct Update {
    slot: Slot,
    booted: Booted,
    phase: Phase,
    length: u32,
    crc: u32,
    received: u32,
    seal: Option<Seal>,
    outcome: Outcome,
    wish: Option<Order>,
    at_work: bool,
}

impl Update {
    /// After a reset. Nothing is taken until it is known how the firmware was started.
    pub const fn new(slot: Slot) -> Self {
        Self {
            slot,
            booted: Booted::Unknown,
            phase: Phase::Nothing,
            length: 0,
            crc: 0,
            received: 0,
            seal: None,
            outcome: Outcome::None,
            wish: None,
            at_work: false,
        }
    }

    /// Announces an image of so many bytes with this CRC-32 (IEEE 802.3); one that was being received is forgotten.
    ///
    /// # Errors
    /// Why not.
    pub fn begin(&mut self, length: u32, crc: u32, motors_run: bool) -> Result<(), Refusal> {
        if motors_run {
            return Err(Refusal::MotorEnabled);
        }
        if matches!(self.booted, Booted::Unknown | Booted::OnTrial) {
            return Err(Refusal::OnTrial);
        }
        self.is_idle()?;
        if self.phase == Phase::Armed {
            return Err(Refusal::Armed);
        }
        if length < VECTORS || length > self.slot.length {
            return Err(Refusal::Length);
        }
        (self.phase, self.outcome) = (Phase::Receiving, Outcome::None);
        (self.length, self.crc, self.received, self.seal) = (length, crc, 0, None);
        Ok(())
    }

    /// Takes the signature of the image that was announced, before its first chunk. Whether it is one is seen when all has come.
    ///
    /// # Errors
    /// Why not.
    pub fn sign(&mut self, seal: Seal) -> Result<(), Refusal> {
        let signer = self.slot.signer.ok_or(Refusal::NoSigner)?;
        if self.phase != Phase::Receiving {
            return Err(Refusal::NotBegun);
        }
        if seal.key != signer {
            return Err(Refusal::OtherKey);
        }
        self.seal = Some(seal);
        Ok(())
    }

    /// Takes the next chunk. One that was taken already, because its answer got lost, changes nothing.
    ///
    /// # Errors
    /// Why not.
    pub fn chunk(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Refusal> {
        if self.phase != Phase::Receiving {
            return Err(Refusal::NotBegun);
        }
        if self.slot.signer.is_some() && self.seal.is_none() {
            return Err(Refusal::Unsigned);
        }
        if offset < self.received && offset.is_multiple_of(CHUNK as u32) {
            return Ok(());
        }
        if offset != self.received {
            return Err(Refusal::Gap);
        }
        let left = self.length.saturating_sub(offset);
        if bytes.is_empty() || bytes.len() as u32 != left.min(CHUNK as u32) {
            return Err(Refusal::ChunkLength);
        }
        if offset == 0 && !self.slot.takes(bytes) {
            return Err(Refusal::NotAnImage);
        }
        self.is_idle()?;
        let bytes = Vec::from_slice(bytes).map_err(|_| Refusal::ChunkLength)?;
        self.received += bytes.len() as u32;
        self.wish = Some(Order::Write { offset, bytes });
        Ok(())
    }

    /// Says that all chunks were sent; the image is checked, and armed. Saying it again changes nothing.
    ///
    /// # Errors
    /// Why not.
    pub fn finish(&mut self) -> Result<(), Refusal> {
        match self.phase {
            Phase::Checking | Phase::Armed => return Ok(()),
            Phase::Receiving => (),
            Phase::Nothing | Phase::Disarming => return Err(Refusal::NotBegun),
        }
        if self.received < self.length {
            return Err(Refusal::Gap);
        }
        self.is_idle()?;
        self.phase = Phase::Checking;
        self.wish = Some(Order::Arm { length: self.length, crc: self.crc, seal: self.seal });
        Ok(())
    }

    /// Starts the image that is armed.
    ///
    /// # Errors
    /// Why not.
    pub fn restart(&mut self, motors_run: bool) -> Result<(), Refusal> {
        if self.phase != Phase::Armed {
            return Err(Refusal::NotArmed);
        }
        if motors_run {
            return Err(Refusal::MotorEnabled);
        }
        if !self.at_work {
            self.wish = Some(Order::Restart);
        }
        Ok(())
    }

    /// Forgets an image, one that is armed too.
    ///
    /// # Errors
    /// While something is being written or checked.
    pub fn abandon(&mut self) -> Result<(), Refusal> {
        self.is_idle()?;
        if self.phase == Phase::Armed {
            self.phase = Phase::Disarming;
            self.wish = Some(Order::Disarm);
        } else {
            self.phase = Phase::Nothing;
        }
        Ok(())
    }

    /// What is to be done next, if anything; [`done`](Self::done) when that has been.
    pub fn order(&mut self) -> Option<Order> {
        if self.at_work {
            return None;
        }
        let order = self.wish.take();
        self.at_work = order.is_some();
        order
    }

    /// Whoever has the slot says something.
    pub fn done(&mut self, done: Done) {
        let outcome = match done {
            Done::Booted(booted) => {
                self.booted = booted;
                return;
            }
            Done::Carried(outcome) => outcome,
        };
        (self.at_work, self.outcome) = (false, outcome);
        self.phase = match (self.phase, outcome) {
            (Phase::Checking, Outcome::Done) => Phase::Armed,
            (Phase::Receiving, Outcome::Done) => Phase::Receiving,
            // What could not be disarmed, or restarted, still is.
            (Phase::Armed, _) | (Phase::Disarming, Outcome::Refused | Outcome::Mismatch) => Phase::Armed,
            _ => Phase::Nothing,
        };
    }

    /// How far it is.
    pub const fn phase(&self) -> Phase {
        self.phase
    }

    /// How the firmware that runs was started.
    pub const fn booted(&self) -> Booted {
        self.booted
    }

    /// What became of the last order.
    pub const fn outcome(&self) -> Outcome {
        self.outcome
    }

    /// Something is being written or checked, or is about to be.
    pub const fn at_work(&self) -> bool {
        self.at_work || self.wish.is_some()
    }

    /// Bytes that were taken, of how many.
    pub const fn progress(&self) -> (u32, u32) {
        (self.received, self.length)
    }

    /// Where images go.
    pub const fn slot(&self) -> Slot {
        self.slot
    }

    const fn is_idle(&self) -> Result<(), Refusal> {
        if self.at_work() { Err(Refusal::AtWork) } else { Ok(()) }
    }
}

/// Bytes of the two vectors that an image begins with.
const VECTORS: u32 = 8;

impl Slot {
    /// The first bytes of an image that can run here: where its stack begins, and its code (ARMv7-M ARM, B1.5.3).
    fn takes(&self, image: &[u8]) -> bool {
        let Some((stack, rest)) = image.split_first_chunk() else { return false };
        let Some((reset, _)) = rest.split_first_chunk() else { return false };
        let (stack, reset) = (u32::from_le_bytes(*stack), u32::from_le_bytes(*reset));
        let in_ram = stack > self.ram.0 && stack <= self.ram.1 && stack.is_multiple_of(8);
        let in_slot = reset.wrapping_sub(self.origin) < self.length && !reset.is_multiple_of(2);
        in_ram && in_slot
    }
}
