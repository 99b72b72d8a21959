//! Answers of the hub. The line of a request in [`requests`](super::requests) states the type of its answer.
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
use super::payload::{Field, Fields, Payload, bits, byte, flag, payload};
use super::refusal::Nack;
use core::fmt;
use heapless::Vec;

/// The bit that a hub sets in the type of a request to make the type of its answer.
pub const RESPONSE: u16 = 0x8000;

const ACK: u16 = 0x7F01;
const NACK: u16 = 0x7F02;

/// The answer to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// The hub has done what was requested.
    Ack {
        /// True if the module status has changed since a host read it.
        attention: bool,
    },
    /// The hub refuses the request, and nothing has changed.
    Nack(Nack),
    /// The values that a host asked for.
    Data(Payload),
}

impl Reply {
    /// An acknowledgement without attention.
    pub const ACK: Self = Self::Ack { attention: false };

    /// An answer with these values.
    pub fn data(answer: &impl Field) -> Self {
        let mut payload = Payload::new();
        answer.write(&mut payload);
        Self::Data(payload)
    }

    /// The packet of the answer, from the hub at `source` to the sender of `request`; `number` is the hub's own count.
    pub fn packet(self, request: &Packet, source: u8, number: u8) -> Packet {
        let byte = |byte| [byte].into_iter().collect();
        let (id, payload) = match self {
            Self::Ack { attention } => (ACK, byte(u8::from(attention))),
            Self::Nack(Nack(code)) => (NACK, byte(code)),
            Self::Data(payload) => (request.id | RESPONSE, payload),
        };
        Packet { destination: request.source, source, number, reference: request.number, id, payload }
    }

    /// Reads `packet` as the answer to a request of type `id`; `None` if the packet is no such answer. The reference of the
    /// packet is not checked.
    pub fn read(packet: &Packet, id: u16) -> Option<Self> {
        let first = packet.payload.first().copied();
        match packet.id {
            // Very old firmware sends no byte.
            ACK => Some(Self::Ack { attention: first.unwrap_or_default() != 0 }),
            NACK => first.map(|code| Self::Nack(Nack(code))),
            response if response == id | RESPONSE => Some(Self::Data(packet.payload.clone())),
            _ => None,
        }
    }
}

payload! {
    /// The packet types of an interface.
    #[derive(Copy)]
    pub struct Functions {
        /// The type of function 0.
        pub first: u16,
        /// The number of functions.
        pub count: u16,
    }
}

impl Functions {
    /// The type of a function; `None` if there is no such function.
    pub fn id(self, number: u16) -> Option<u16> {
        self.first.checked_add(number).filter(|_| number < self.count)
    }

    /// The function of a type; `None` if the type belongs to another interface.
    pub const fn number(self, id: u16) -> Option<u16> {
        match id.checked_sub(self.first) {
            Some(number) if number < self.count => Some(number),
            _ => None,
        }
    }
}

payload! {
    /// Module status.
    #[derive(Copy, Default)]
    pub struct Status {
        /// Events and states of the hub, one bit each.
        pub status: u8,
        /// Alerts: bits 0 to 3 are set if motor 0 to 3 lost counts, bits 4 to 7 if the bridge of motor 0 to 3 is too hot.
        pub motor_alerts: u8,
    }
}

/// An alert of one motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorAlert {
    /// The motor, 0 to 3.
    pub motor: usize,
    /// The alert as text.
    pub text: &'static str,
}

impl fmt::Display for MotorAlert {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "motor {} {}", self.motor, self.text)
    }
}

impl Status {
    /// The keep-alive timer ran out.
    pub const KEEP_ALIVE_TIMEOUT: u8 = 1;
    /// The hub has been reset.
    pub const RESET: u8 = 1 << 1;
    /// A host asked for fail-safe.
    pub const FAIL_SAFE: u8 = 1 << 2;
    /// The battery is low.
    pub const BATTERY_LOW: u8 = 1 << 4;

    /// Texts of the status bits from bit 0 on.
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

    /// Texts of the status bits that are set.
    pub fn words(self) -> Vec<&'static str, 8> {
        let bits = Self::WORDS.iter().enumerate().filter(|(bit, _)| self.status & 1 << bit != 0);
        bits.map(|(_, word)| *word).collect()
    }

    /// The motor alerts that are set.
    pub fn alerts(self) -> Vec<MotorAlert, 8> {
        let of = |first, text| (0..CHANNELS).map(move |motor| (first + motor, MotorAlert { motor, text }));
        let all = of(0, "lost counts").chain(of(4, "bridge too hot"));
        all.filter(|(bit, _)| self.motor_alerts & 1 << bit != 0).map(|(_, alert)| alert).collect()
    }
}

/// All values that change while motors run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bulk {
    /// Levels of the digital inputs: bit i is input i.
    pub digital: u8,
    /// Positions in counts, by motor.
    pub encoders: [i32; CHANNELS],
    /// True if the current exceeds the motor's current alert, by motor.
    pub over_current: [bool; CHANNELS],
    /// True in position mode within the tolerance of the target, whatever the speed, by motor.
    pub within_tolerance: [bool; CHANNELS],
    /// Velocities in counts per second, by motor.
    pub velocities: [i16; CHANNELS],
    /// Analog inputs in millivolts.
    pub analog: [i16; CHANNELS],
    /// True if the module status has changed since a host read it; `None` from firmware up to 1.8.2, which does not report this.
    pub attention: Option<bool>,
}

/// 35 bytes, or 34 without the attention. One byte has bits of all motors: over-current from bit 0 on, within tolerance from
/// bit 4 on.
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
    /// Version of firmware and hardware. Hosts derive the functions of a hub from the version: PIDF from 1.8.2 on.
    #[derive(Copy, Default)]
    #[expect(missing_docs, reason = "the names of the protocol")]
    pub struct Version {
        pub engineering: u8,
        pub minor: u8,
        pub major: u8,
        pub hardware_minor: u8,
        pub hardware_major: u8,
        /// The type of hub.
        pub hardware: u32,
    }
}
