//! Frames: bytes to packets, with synchronisation after any garbage; and packets to bytes.
//!
//! A frame is `44 4B`, the length of the frame (16 bits, little-endian), destination, source, message number, reference, type
//! (16 bits), payload, and a checksum. The checksum is the sum of all bytes before it, modulo 256.
//!
//! ```
//! use motor_hub::protocol::frame::{Decoder, Packet, encode};
//! use motor_hub::units::Micros;
//!
//! let keep_alive = Packet { destination: 3, number: 1, id: 0x7F04, ..Packet::default() };
//! let frame = encode(&keep_alive);
//! assert_eq!(*frame, [0x44, 0x4B, 11, 0, 3, 0, 1, 0, 0x04, 0x7F, 0x21]);
//!
//! // Stray bytes before the frame do no harm.
//! let bytes = [&[0x44, 0x44, 0x00], &*frame].concat();
//! assert_eq!(Decoder::new().next(&mut &*bytes, Micros::new(0)), Some(keep_alive));
//! ```

use super::payload::{PAYLOAD_KEPT, Payload};
use crate::units::Micros;
use heapless::Vec;

/// The first bytes of every frame.
pub const START: [u8; 2] = [0x44, 0x4B];

/// Bytes of a frame without payload.
pub const OVERHEAD: usize = 11;

/// The longest frame that is read. Hosts send at most 512 bytes of payload.
pub const LONGEST: usize = 600;

/// Time after the first byte of a frame within which the frame must be complete.
pub const TIMEOUT_MICROS: u64 = 50_000;

/// A packet whose checksum was good, to any destination.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Packet {
    /// Destination: 0 host, 1 to 254 a hub, 255 every hub.
    pub destination: u8,
    /// Address of the sender.
    pub source: u8,
    /// Message number. Hosts use a number for several requests.
    pub number: u8,
    /// Message number of the request, in a reply.
    pub reference: u8,
    /// Packet type.
    pub id: u16,
    /// The first [`PAYLOAD_KEPT`] bytes of the payload.
    pub payload: Payload,
}

/// Finds packets in a stream of bytes.
///
/// The decoder keeps bytes until they cannot start a frame any more. The search after a bad frame begins at its second byte, so
/// a good packet within a bad frame is not lost.
#[derive(Debug)]
pub struct Decoder {
    /// Received bytes. The first byte is `44`.
    bytes: Vec<u8, LONGEST>,
    /// Time of the first byte, or later.
    first_at: Micros,
    /// Time of the last byte.
    last_at: Micros,
}

/// What the received bytes are.
enum Candidate {
    /// The start of a frame, perhaps.
    Unfinished,
    /// No frame, at the first byte.
    Bad,
    /// A frame of this length.
    Good(usize),
}

impl Decoder {
    /// A decoder without bytes.
    pub const fn new() -> Self {
        Self { bytes: Vec::new(), first_at: Micros::new(0), last_at: Micros::new(0) }
    }

    /// Takes bytes off the front of `input` until a packet is complete; `None` if `input` is used up. The bytes have come by
    /// `now`. To be called with empty input at [`deadline`](Self::deadline).
    pub fn next(&mut self, input: &mut &[u8], now: Micros) -> Option<Packet> {
        loop {
            match self.candidate() {
                Candidate::Good(length) => return Some(self.take(length)),
                Candidate::Bad => self.drop_bytes(1),
                // After a pause this drops one unfinished frame after the other.
                Candidate::Unfinished if self.deadline().is_some_and(|deadline| deadline <= now) => {
                    self.drop_bytes(1);
                }
                Candidate::Unfinished => {
                    let (&byte, rest) = input.split_first()?;
                    *input = rest;
                    self.push(byte, now);
                }
            }
        }
    }

    /// Time at which the decoder drops an unfinished frame; `None` without one.
    pub fn deadline(&self) -> Option<Micros> {
        (!self.bytes.is_empty()).then_some(Micros::new(self.first_at.get().saturating_add(TIMEOUT_MICROS)))
    }

    fn push(&mut self, byte: u8, now: Micros) {
        if self.bytes.is_empty() {
            if byte != START[0] {
                return;
            }
            self.first_at = now;
        }
        self.last_at = now;
        // There is room, because a full buffer has at least one complete frame.
        let _ = self.bytes.push(byte);
    }

    fn candidate(&self) -> Candidate {
        let length = match *self.bytes {
            [_, second, ..] if second != START[1] => return Candidate::Bad,
            [_, _, low, high, ..] => usize::from(u16::from_le_bytes([low, high])),
            _ => return Candidate::Unfinished,
        };
        if !(OVERHEAD..=LONGEST).contains(&length) {
            return Candidate::Bad;
        }
        match self.bytes.get(..length).and_then(<[u8]>::split_last) {
            None => Candidate::Unfinished,
            Some((sum, bytes)) if *sum == checksum(bytes) => Candidate::Good(length),
            Some(_) => Candidate::Bad,
        }
    }

    /// Removes the frame at the front.
    fn take(&mut self, length: usize) -> Packet {
        let [_, _, _, _, destination, source, number, reference, id_low, id_high, ref rest @ ..] =
            *self.bytes
        else {
            return Packet::default();
        };
        // The packet keeps the first bytes of a long payload only.
        let kept = length.saturating_sub(OVERHEAD).min(PAYLOAD_KEPT);
        let payload = rest.iter().copied().take(kept).collect();
        let id = u16::from_le_bytes([id_low, id_high]);
        self.drop_bytes(length);
        Packet { destination, source, number, reference, id, payload }
    }

    /// Drops bytes, and then what cannot start a frame.
    fn drop_bytes(&mut self, count: usize) {
        let start = self.bytes.iter().skip(count).position(|byte| *byte == START[0]);
        let dropped = start.map_or(self.bytes.len(), |start| count + start);
        self.bytes.drain(..dropped);
        // The time of the new first byte is unknown, and not after the time of the last byte.
        self.first_at = self.last_at;
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

/// The bytes of a packet on the line.
pub type Frame = Vec<u8, { OVERHEAD + PAYLOAD_KEPT }>;

/// The frame of `packet`.
pub fn encode(packet: &Packet) -> Frame {
    let [id_low, id_high] = packet.id.to_le_bytes();
    // The length is OVERHEAD + PAYLOAD_KEPT at most.
    let [length_low, length_high] = ((OVERHEAD + packet.payload.len()) as u16).to_le_bytes();
    let head = [
        START[0],
        START[1],
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
    // There is room by the types.
    let _ = frame.extend_from_slice(&head);
    let _ = frame.extend_from_slice(&packet.payload);
    let _ = frame.push(checksum(&frame));
    frame
}

fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}
