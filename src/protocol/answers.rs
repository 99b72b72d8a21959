//! Answers of the hub. The table in [`requests`](super::requests) states for each request the type of its answer.
//!
//! ```
//! use motor_hub::extension::Request;
//! use motor_hub::protocol::answers::{Reply, Status};
//! use motor_hub::protocol::payload::{Field, Fields};
//! use motor_hub::protocol::requests::Standard;
//!
//! let request = Request::from(Standard::Status { clear: false });
//! let asked = request.packet(3, 1, request.id());
//!
//! // The host reads what the hub writes.
//! let status = Status { status: Status::RESET, motor_alerts: 0 };
//! let answered = Reply::data(&status).packet(&asked, 3, 1);
//! let Some(Reply::Data(payload)) = Reply::read(&answered, request.id()) else { panic!() };
//! assert_eq!(Status::read(&mut Fields::new(&payload)), Ok(status));
//! assert_eq!(status.words(), ["device reset"]);
//! ```

use super::CHANNELS;
use super::frame::Packet;
use super::payload::{Field, Fields, Payload, Text, bits, byte, flag, payload};
use super::refusal::Nack;
use heapless::Vec;

/// Bit that distinguishes the packet type of an answer from the packet type of its request.
pub const RESPONSE: u16 = 0x8000;

/// Packet type of an acknowledgement.
const ACK: u16 = 0x7F01;
/// Packet type of a refusal.
const NACK: u16 = 0x7F02;

/// The answer to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// The hub has executed the request.
    Ack {
        /// True if the module status has events that no host has cleared.
        attention: bool,
    },
    /// The hub has refused the request. A refused request changes neither settings nor motion.
    Nack(Nack),
    /// The hub answers with values.
    Data(Payload),
}

impl Reply {
    /// An acknowledgement without attention.
    pub const ACK: Self = Self::Ack { attention: false };

    /// Creates an answer with values.
    pub fn data(answer: &impl Field) -> Self {
        let mut payload = Payload::new();
        answer.write(&mut payload);
        Self::Data(payload)
    }

    /// Builds the packet of the answer, from the hub at `source` to the sender of `request`. `number` is the message
    /// number of the answer.
    pub fn packet(self, request: &Packet, source: u8, number: u8) -> Packet {
        let byte = |byte| [byte].into_iter().collect();
        let (id, payload) = match self {
            Self::Ack { attention } => (ACK, byte(u8::from(attention))),
            Self::Nack(Nack(code)) => (NACK, byte(code)),
            Self::Data(payload) => (request.id | RESPONSE, payload),
        };
        Packet { destination: request.source, source, number, reference: request.number, id, payload }
    }

    /// Reads the answer to a request of type `id` from a packet. `None` if the packet is not an answer to this type of
    /// request. The caller must compare the packet's reference with the request's number.
    pub fn read(packet: &Packet, id: u16) -> Option<Self> {
        let first = packet.payload.first().copied();
        match packet.id {
            // Very old firmware sends an acknowledgement without payload.
            ACK => Some(Self::Ack { attention: first.unwrap_or_default() != 0 }),
            NACK => first.map(|code| Self::Nack(Nack(code))),
            response if response == id | RESPONSE => Some(Self::Data(packet.payload.clone())),
            _ => None,
        }
    }
}

payload! {
    /// The packet types of an interface's functions, which are consecutive.
    #[derive(Copy)]
    pub struct Functions {
        /// Packet type of function 0.
        pub first: u16,
        /// Number of functions.
        pub count: u16,
    }
}

impl Functions {
    /// Returns the packet type of a function. `None` if the interface does not have this function.
    pub fn id(self, number: u16) -> Option<u16> {
        self.first.checked_add(number).filter(|_| number < self.count)
    }

    /// Returns the number of the function with this packet type. `None` if the type belongs to another interface.
    pub const fn number(self, id: u16) -> Option<u16> {
        match id.checked_sub(self.first) {
            Some(number) if number < self.count => Some(number),
            _ => None,
        }
    }
}

payload! {
    /// Module status: states and events of the hub, and alerts of its motors.
    #[derive(Copy, Default)]
    pub struct Status {
        /// States and events of the hub, one bit each.
        pub status: u8,
        /// Alerts of motors. Bit i is set if motor i has lost counts. Bit 4 + i is set if the bridge of motor i is too
        /// hot. A hub of this project reports an encoder fault as lost counts, and a bridge that has switched itself
        /// off as too hot.
        pub motor_alerts: u8,
    }
}

impl Status {
    /// The keep-alive timer has run out.
    pub const KEEP_ALIVE_TIMEOUT: u8 = 1;
    /// The hub has been reset.
    pub const RESET: u8 = 1 << 1;
    /// A host has requested fail-safe.
    pub const FAIL_SAFE: u8 = 1 << 2;
    /// The battery is low.
    pub const BATTERY_LOW: u8 = 1 << 4;

    /// Texts of the status bits, beginning with bit 0.
    const WORDS: [&str; 8] = [
        "keep-alive timeout",
        "device reset",
        "fail-safe",
        "controller too hot",
        "battery low",
        "interface board fault",
        "bit 6",
        "bit 7",
    ];

    /// Returns the texts of the status bits that are set.
    pub fn words(self) -> Vec<&'static str, 8> {
        let bits = Self::WORDS.iter().enumerate().filter(|(bit, _)| self.status & 1 << bit != 0);
        bits.map(|(_, word)| *word).collect()
    }

    /// Returns the texts of the alerts that are set for the motor with this number, 0 to 3.
    pub fn alerts(self, motor: usize) -> Vec<&'static str, 2> {
        let [lost_counts, too_hot] = [self.motor_alerts & 0x0F, self.motor_alerts >> 4];
        let all = [("lost counts", lost_counts), ("bridge too hot", too_hot)];
        let set = all.into_iter().filter(|(_, motors)| bits(*motors).get(motor) == Some(&true));
        set.map(|(text, _)| text).collect()
    }
}

/// Bulk input: all values that hosts read regularly, in one answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bulk {
    /// Levels of the digital inputs. Bit i stands for input i.
    pub digital: u8,
    /// Position of each motor in counts.
    pub encoders: [i32; CHANNELS],
    /// For each motor, true if its current exceeds its current alert.
    pub over_current: [bool; CHANNELS],
    /// For each motor, true if the motor is enabled in position mode, is in no group, and is within the tolerance of
    /// its target, at any speed.
    pub within_tolerance: [bool; CHANNELS],
    /// Velocity of each motor in counts per second.
    pub velocities: [i16; CHANNELS],
    /// Analog inputs in millivolts.
    pub analog: [i16; CHANNELS],
    /// True if the module status has events that no host has cleared. `None` from REV's firmware up to 1.8.2, which
    /// lacks this field.
    pub attention: Option<bool>,
}

/// The payload has 35 bytes, or 34 without `attention`. One byte has two bits of each motor: bit i is `over_current` of
/// motor i, and bit 4 + i is `within_tolerance` of motor i.
impl Field for Bulk {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let (digital, encoders) = (u8::read(fields)?, Field::read(fields)?);
        let [a, b, c, d, within_tolerance @ ..] = bits(u8::read(fields)?);
        Ok(Self {
            digital,
            encoders,
            over_current: [a, b, c, d],
            within_tolerance,
            velocities: Field::read(fields)?,
            analog: Field::read(fields)?,
            attention: flag::read(fields).ok(),
        })
    }

    fn write(&self, payload: &mut Payload) {
        self.digital.write(payload);
        self.encoders.write(payload);
        byte(self.over_current.into_iter().chain(self.within_tolerance)).write(payload);
        self.velocities.write(payload);
        self.analog.write(payload);
        if let Some(attention) = self.attention {
            attention.write(payload);
        }
    }
}

payload! {
    /// Version of firmware and hardware. Hosts derive the available functions from the version. For example, they use
    /// PIDF with firmware 1.8.2 and later.
    #[derive(Copy, Default)]
    #[expect(missing_docs, reason = "the names of the protocol")]
    pub struct Version {
        pub engineering: u8,
        pub minor: u8,
        pub major: u8,
        pub hardware_minor: u8,
        pub hardware_major: u8,
        /// REV's number for the type of hub.
        pub hardware: u32,
    }
}

payload! {
    /// How an I2C transfer ended. No bit is set after a transfer without error.
    #[derive(Copy, Default)]
    pub struct I2cStatus {
        /// The errors, one bit each.
        pub bits: u8,
    }
}

impl I2cStatus {
    /// No device has acknowledged the address.
    pub const NO_ADDRESS: Self = Self { bits: 1 };
    /// The device has not acknowledged a byte.
    pub const NO_DATA: Self = Self { bits: 1 << 1 };
    /// Another controller has used the bus, or a line was low that should be high.
    pub const ARBITRATION_LOST: Self = Self { bits: 1 << 2 };
    /// The transfer did not end in time, or ended with an error that no other bit stands for.
    pub const TIME_OUT: Self = Self { bits: 1 << 3 };

    /// Returns the text of the lowest error bit that is set. `None` without error.
    pub const fn error(self) -> Option<&'static str> {
        Some(match self.bits.trailing_zeros() {
            0 => "no device acknowledges this address",
            1 => "the device did not acknowledge a byte",
            2 => "arbitration lost",
            3 => "time-out: a line is stuck, or a device holds the clock",
            8.. => return None,
            _ => "an error that the protocol does not define",
        })
    }
}

payload! {
    /// Result of a read on an I2C bus.
    #[derive(Default)]
    pub struct I2cRead {
        /// How the transfer ended.
        pub status: I2cStatus,
        /// The bytes that were read. Empty after an error.
        pub bytes: Text,
    }
}

payload! {
    /// Result of a write on an I2C bus.
    #[derive(Copy, Default)]
    pub struct I2cWritten {
        /// How the transfer ended.
        pub status: I2cStatus,
        /// Number of bytes that were written; 0 after an error.
        pub count: u8,
    }
}
