//! Requests as bytes, and what answers mean.
//!
//! Written apart from the hub's encoder. Parsing is the hub's own [`motor_hub::link::Decoder`], whose
//! packets look the same in both directions.

use motor_hub::link::{HOST, Packet, frame};
use std::fmt;

/// Bit 15 of a request's type makes the type of its data response.
pub const RESPONSE: u16 = 0x8000;

const ACK: u16 = 0x7F01;
const NACK: u16 = 0x7F02;

/// A request of type `id` as one frame. `payload` is cut off where a frame's length ends, which is far
/// beyond what any hub takes.
pub fn request(destination: u8, number: u8, id: u16, payload: &[u8]) -> Vec<u8> {
    let length = u16::try_from(frame::OVERHEAD + payload.len()).unwrap_or(u16::MAX);
    let kept = usize::from(length).saturating_sub(frame::OVERHEAD);
    let mut bytes = frame::START.to_vec();
    bytes.extend(length.to_le_bytes());
    bytes.extend([destination, HOST, number, 0]);
    bytes.extend(id.to_le_bytes());
    bytes.extend(payload.iter().take(kept));
    bytes.push(bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
    bytes
}

/// What a hub answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Ack {
        /// The module status has something to say.
        attention: bool,
    },
    /// Refused; nothing has changed.
    Nack(Refusal),
    /// What was asked for.
    Data(Vec<u8>),
}

impl Answer {
    /// `packet` as the answer to a request of type `id`; `None` if it is none, whatever its reference.
    pub fn read(packet: &Packet, id: u16) -> Option<Self> {
        let first = packet.payload.first().copied();
        match packet.id {
            // Very old firmware sends no byte.
            ACK => Some(Self::Ack { attention: first.unwrap_or_default() != 0 }),
            NACK => first.map(|code| Self::Nack(Refusal(code))),
            response if response == id | RESPONSE => Some(Self::Data(packet.payload.to_vec())),
            _ => None,
        }
    }
}

/// The reason byte of a NACK.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal(pub u8);

impl Refusal {
    /// The first parameter, which for motors is the channel, is out of range.
    pub const NO_SUCH_CHANNEL: Self = Self(0);
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let code = self.0;
        match code {
            0..=9 => write!(f, "parameter {code} (counted from 0) is out of range"),
            10..=17 => write!(f, "digital pin {} is not an output", code - 10),
            18 => f.write_str("no digital pin is an output"),
            20..=27 => write!(f, "digital pin {} is not an input", code - 20),
            28 => f.write_str("no digital pin is an input"),
            30 => f.write_str("servo not configured"),
            31 => f.write_str("battery too low for servos"),
            40 => f.write_str("I2C busy"),
            41 => f.write_str("I2C transfer in progress"),
            42 => f.write_str("no I2C result pending"),
            43 => f.write_str("I2C query does not match the last transfer"),
            44 => f.write_str("I2C data line stuck"),
            45 => f.write_str("I2C clock line stuck"),
            46 => f.write_str("I2C timeout"),
            50 => f.write_str("no target set for this mode"),
            51 => f.write_str("not in the motor's present mode"),
            52 => f.write_str("battery too low"),
            253 => f.write_str("this hub does not have it"),
            254 => f.write_str("known command, not routed"),
            255 => f.write_str("unknown command"),
            _ => f.write_str("a reason that the protocol does not know"),
        }?;
        write!(f, " (NACK {code})")
    }
}
