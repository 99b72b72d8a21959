//! Frames: the bytes of a packet on a link. The decoder skips stray bytes and damaged frames.
//!
//! | bytes | field |
//! |---|---|
//! | `44 4B` | start |
//! | u16 | length of the frame, little-endian |
//! | u8, u8 | destination, source |
//! | u8, u8 | message number, reference |
//! | u16 | packet type |
//! | | payload |
//! | u8 | checksum: the sum of all bytes before it, modulo 256 |
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

/// First bytes of every frame.
pub const START: [u8; 2] = [0x44, 0x4B];

/// Length of a frame without payload, in bytes.
pub const OVERHEAD: usize = 11;

/// Length of the longest frame that the decoder accepts, in bytes. Hosts send frames of at most 523 bytes, with a
/// payload of 512.
pub const LONGEST: usize = 600;

/// Time in microseconds from the first byte of a frame, after which the decoder drops an unfinished frame.
pub const TIMEOUT_MICROS: u64 = 50_000;

/// A packet to any destination.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Packet {
    /// Address of the receiver: 0 is the host, 1 to 254 a hub, 255 all hubs.
    pub destination: u8,
    /// Address of the sender.
    pub source: u8,
    /// Message number. Hosts may use one number for several requests.
    pub number: u8,
    /// In a reply, the message number of the request.
    pub reference: u8,
    /// Packet type.
    pub id: u16,
    /// The first [`PAYLOAD_KEPT`] bytes of the payload.
    pub payload: Payload,
}

/// Finds packets in a stream of bytes.
///
/// After a damaged frame the search continues with the second byte of that frame. A good frame that begins inside a
/// damaged one is therefore found.
#[derive(Debug)]
pub struct Decoder {
    /// Received bytes from a possible start of a frame on. The first byte is `44`.
    bytes: Vec<u8, LONGEST>,
    /// Time at which the first of `bytes` arrived. After bytes were dropped, the time at which the last byte arrived.
    first_at: Micros,
    /// Time at which the last byte arrived.
    last_at: Micros,
}

/// What the received bytes may be the beginning of.
enum Candidate {
    /// Possibly the beginning of a frame that is not complete yet.
    Unfinished,
    /// No frame begins at the first byte.
    Bad,
    /// A complete frame of this length, with a correct checksum.
    Good(usize),
}

impl Decoder {
    /// Creates a decoder that has received no bytes.
    pub const fn new() -> Self {
        Self { bytes: Vec::new(), first_at: Micros::new(0), last_at: Micros::new(0) }
    }

    /// Removes bytes from the front of `input` until a packet is complete. `None` if all bytes were removed without a
    /// packet.
    ///
    /// `now` is the time at which the bytes have arrived. The method must also be called at the time
    /// [`deadline`](Self::deadline), with an empty `input` if there are no bytes.
    pub fn next(&mut self, input: &mut &[u8], now: Micros) -> Option<Packet> {
        loop {
            match self.candidate() {
                Candidate::Good(length) => return Some(self.take(length)),
                Candidate::Bad => self.drop_bytes(1),
                // The bytes of an unfinished frame may contain further starts of frames, which are dropped one after
                // the other.
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

    /// Returns the time at which an unfinished frame is dropped. `None` without an unfinished frame.
    pub fn deadline(&self) -> Option<Micros> {
        (!self.bytes.is_empty()).then_some(Micros::new(self.first_at.get().saturating_add(TIMEOUT_MICROS)))
    }

    /// Appends a received byte. While no frame has begun, ignores all bytes except `44`.
    fn push(&mut self, byte: u8, now: Micros) {
        if self.bytes.is_empty() {
            if byte != START[0] {
                return;
            }
            self.first_at = now;
        }
        self.last_at = now;
        // There is room, because a full buffer holds a complete or a bad frame, which has been removed.
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

    /// Removes the complete frame at the front, and returns its packet.
    fn take(&mut self, length: usize) -> Packet {
        let [_, _, _, _, destination, source, number, reference, id_low, id_high, ref rest @ ..] =
            *self.bytes
        else {
            return Packet::default();
        };
        // A packet has only the first bytes of a long payload.
        let kept = length.saturating_sub(OVERHEAD).min(PAYLOAD_KEPT);
        let payload = rest.iter().copied().take(kept).collect();
        let id = u16::from_le_bytes([id_low, id_high]);
        self.drop_bytes(length);
        Packet { destination, source, number, reference, id, payload }
    }

    /// Drops this number of bytes, and then all bytes before the next `44`.
    fn drop_bytes(&mut self, count: usize) {
        let start = self.bytes.iter().skip(count).position(|byte| *byte == START[0]);
        let dropped = start.map_or(self.bytes.len(), |start| count + start);
        self.bytes.drain(..dropped);
        // The new first byte arrived at an unknown time, at the latest with the last byte.
        self.first_at = self.last_at;
    }
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

/// The bytes of a frame.
pub type Frame = Vec<u8, { OVERHEAD + PAYLOAD_KEPT }>;

/// Encodes a packet as a frame.
pub fn encode(packet: &Packet) -> Frame {
    let [id_low, id_high] = packet.id.to_le_bytes();
    // The length fits in 16 bits, because a payload has at most PAYLOAD_KEPT bytes.
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
    // The capacity of the type is enough for the longest payload.
    let _ = frame.extend_from_slice(&head);
    let _ = frame.extend_from_slice(&packet.payload);
    let _ = frame.push(checksum(&frame));
    frame
}

fn checksum(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum.wrapping_add(*byte))
}
