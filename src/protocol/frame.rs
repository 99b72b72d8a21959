//! Frames: bytes in, packets out, synchronised again after any garbage; and packets as bytes.
//!
//! A frame is `44 4B`, length of the whole (16 bits, little-endian), destination, source, message
//! number, reference, type (16 bits), payload, and the sum of all bytes before it modulo 256.
//!
//! ```
//! use motor_hub::protocol::frame::{Decoder, Packet, encode};
//! use motor_hub::units::Micros;
//!
//! let keep_alive = Packet { destination: 3, number: 1, id: 0x7F04, ..Packet::default() };
//! let frame = encode(&keep_alive);
//! assert_eq!(*frame, [0x44, 0x4B, 11, 0, 3, 0, 1, 0, 0x04, 0x7F, 0x21]);
//!
//! // Stray bytes before it do no harm.
//! let bytes = [&[0x44, 0x44, 0x00], &*frame].concat();
//! assert_eq!(Decoder::new().next(&mut &*bytes, Micros::new(0)), Some(keep_alive));
//! ```

use super::fields::{PAYLOAD_KEPT, Payload};
use crate::units::Micros;
use heapless::{Deque, Vec};

/// What every frame starts with.
pub const START: [u8; 2] = [0x44, 0x4B];

/// Bytes of a frame without payload.
pub const OVERHEAD: usize = 11;

/// The longest frame taken: hosts are known to send at most 512 bytes of payload.
pub const LONGEST: usize = 600;

/// A frame that is not complete this long after its first byte is given up.
pub const PATIENCE_MICROS: u64 = 50_000;

/// A packet with a good checksum, to whomever.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Packet {
    /// 0 host, 1 to 254 a hub, 255 every hub.
    pub destination: u8,
    /// Who sent it.
    pub source: u8,
    /// Any value; hosts repeat numbers for different commands.
    pub number: u8,
    /// In a reply, the number of the request.
    pub reference: u8,
    /// What it is.
    pub id: u16,
    /// The first [`PAYLOAD_KEPT`] bytes of the payload.
    pub payload: Payload,
}

/// Finds packets in a stream of bytes.
///
/// Bytes are kept until they are known not to start a frame. When a frame turns out bad, the search
/// goes on at its second byte, so a good packet within a bad one is not lost.
#[derive(Debug)]
pub struct Decoder {
    /// Starts with `44` unless it is empty.
    bytes: Deque<u8, LONGEST>,
    /// When the first of `bytes` came, or later.
    first_at: Micros,
    /// When the last of `bytes` came.
    last_at: Micros,
}

/// What the bytes at hand are.
enum Candidate {
    /// The start of something.
    Unfinished,
    /// No frame starts with the first byte.
    Bad,
    /// A frame of this length.
    Good(usize),
}

impl Decoder {
    /// Has seen nothing.
    pub const fn new() -> Self {
        Self { bytes: Deque::new(), first_at: Micros::new(0), last_at: Micros::new(0) }
    }

    /// Takes bytes off the front of `input`, all of which have come by `now`, until a packet is
    /// complete. `None` means that `input` is used up.
    ///
    /// To be called with empty input at [`deadline`](Self::deadline).
    pub fn next(&mut self, input: &mut &[u8], now: Micros) -> Option<Packet> {
        loop {
            match self.candidate() {
                Candidate::Good(length) => return Some(self.take(length)),
                Candidate::Bad => self.resynchronise(),
                // After a silence this drops one unfinished frame after the other.
                Candidate::Unfinished if self.deadline().is_some_and(|deadline| deadline <= now) => {
                    self.resynchronise();
                }
                Candidate::Unfinished => {
                    let (&byte, rest) = input.split_first()?;
                    *input = rest;
                    self.push(byte, now);
                }
            }
        }
    }

    /// When the unfinished frame at hand, if any, is given up.
    pub fn deadline(&self) -> Option<Micros> {
        (!self.bytes.is_empty()).then_some(Micros::new(self.first_at.get().saturating_add(PATIENCE_MICROS)))
    }

    fn push(&mut self, byte: u8, now: Micros) {
        if self.bytes.is_empty() {
            if byte != START[0] {
                return;
            }
            self.first_at = now;
        }
        self.last_at = now;
        // There is room: a full buffer holds at least one whole frame, which is not unfinished.
        let _ = self.bytes.push_back(byte);
    }

    fn candidate(&self) -> Candidate {
        let mut bytes = self.bytes.iter().copied();
        let (Some(_), second) = (bytes.next(), bytes.next()) else { return Candidate::Unfinished };
        if second.is_some_and(|second| second != START[1]) {
            return Candidate::Bad;
        }
        let (Some(low), Some(high)) = (bytes.next(), bytes.next()) else { return Candidate::Unfinished };
        let length = usize::from(u16::from_le_bytes([low, high]));
        if !(OVERHEAD..=LONGEST).contains(&length) {
            return Candidate::Bad;
        }
        if self.bytes.len() < length {
            return Candidate::Unfinished;
        }
        let sum = self.bytes.iter().take(length - 1).fold(0u8, |sum, byte| sum.wrapping_add(*byte));
        if self.bytes.get(length - 1) == Some(&sum) { Candidate::Good(length) } else { Candidate::Bad }
    }

    /// The frame at the front as a packet.
    fn take(&mut self, length: usize) -> Packet {
        let mut packet = Packet::default();
        for at in 0..length {
            let byte = self.bytes.pop_front().unwrap_or_default();
            match at {
                4 => packet.destination = byte,
                5 => packet.source = byte,
                6 => packet.number = byte,
                7 => packet.reference = byte,
                8 => packet.id = u16::from(byte),
                9 => packet.id |= u16::from(byte) << 8,
                // Full: surplus payload, which nobody looks at.
                10.. if at + 1 < length => drop(packet.payload.push(byte)),
                _ => (),
            }
        }
        self.synchronise();
        packet
    }

    /// Drops the first byte and what cannot start a frame after it.
    fn resynchronise(&mut self) {
        self.bytes.pop_front();
        self.synchronise();
    }

    fn synchronise(&mut self) {
        while self.bytes.front().is_some_and(|&byte| byte != START[0]) {
            self.bytes.pop_front();
        }
        // Not known for the byte that is now the first: no later than the last.
        self.first_at = self.last_at;
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

/// A packet as it goes over the line.
pub type Frame = Vec<u8, { OVERHEAD + PAYLOAD_KEPT }>;

/// The frame of `packet`.
pub fn encode(packet: &Packet) -> Frame {
    let [id_low, id_high] = packet.id.to_le_bytes();
    // At most OVERHEAD + PAYLOAD_KEPT, hence one byte would do.
    let [length_low, length_high] = ((OVERHEAD + packet.payload.len()) as u16).to_le_bytes();
    let [start, second] = START;
    let head = [
        start,
        second,
        length_low,
        length_high,
        packet.destination,
        packet.source,
        packet.number,
        packet.reference,
        id_low,
        id_high,
    ];
    let mut frame = Frame::new();
    let mut sum = 0u8;
    for &byte in head.iter().chain(&packet.payload) {
        sum = sum.wrapping_add(byte);
        // There is room, by the types.
        let _ = frame.push(byte);
    }
    let _ = frame.push(sum);
    frame
}
