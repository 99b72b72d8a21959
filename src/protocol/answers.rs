//! Every answer, as both ends see it. What a request is answered with, its line in
//! [`requests`](super::requests) says.
//!
//! ```
//! use motor_hub::protocol::answers::{Reply, Status};
//! use motor_hub::protocol::fields::{Field, Fields};
//! use motor_hub::protocol::requests::{Request, Standard};
//!
//! let request = Request::from(Standard::Status { clear: false });
//! let asked = request.packet(3, 1, request.id());
//!
//! // What the hub writes, the host reads.
//! let status = Status { status: Status::RESET, motor_alerts: 0 };
//! let answered = Reply::data(&status).packet(&asked, 3, 1);
//! let Some(Reply::Data(payload)) = Reply::read(&answered, request.id()) else { panic!() };
//! assert_eq!(Status::read(&mut Fields::new(&payload)), Ok(status));
//! assert_eq!(status.words(), ["device reset"]);
//! ```

use super::CHANNELS;
use super::fields::{Field, Fields, Payload, in_turn};
use super::frame::Packet;
use super::nack::Nack;
use core::fmt;
use heapless::Vec;

/// Bit 15 of a request's type makes the type of its data response.
pub const RESPONSE: u16 = 0x8000;

const ACK: u16 = 0x7F01;
const NACK: u16 = 0x7F02;

/// What a request is answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Done.
    Ack {
        /// The module status has something to say.
        attention: bool,
    },
    /// Refused; nothing has changed.
    Nack(Nack),
    /// What was asked for.
    Data(Payload),
}

impl Reply {
    /// What was asked for.
    pub fn data(answer: &impl Field) -> Self {
        let mut payload = Payload::new();
        answer.write(&mut payload);
        Self::Data(payload)
    }

    /// The packet in which the hub at `source` says it to whoever sent `request`; `number` is the hub's
    /// own count.
    pub fn packet(self, request: &Packet, source: u8, number: u8) -> Packet {
        let byte = |byte| [byte].into_iter().collect();
        let (id, payload) = match self {
            Self::Ack { attention } => (ACK, byte(u8::from(attention))),
            Self::Nack(Nack(code)) => (NACK, byte(code)),
            Self::Data(payload) => (request.id | RESPONSE, payload),
        };
        Packet { destination: request.source, source, number, reference: request.number, id, payload }
    }

    /// `packet` as the answer to a request of type `id`; `None` if it is none, whatever its reference.
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

/// The types of an interface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Functions {
    /// That of function 0.
    pub first: u16,
    /// How many there are.
    pub count: u16,
}

impl Functions {
    /// The type of a function; `None` if there is no such function.
    pub fn id(self, number: u16) -> Option<u16> {
        self.first.checked_add(number).filter(|_| number < self.count)
    }

    /// The function of a type; `None` if it is not among these.
    pub fn number(self, id: u16) -> Option<u16> {
        id.checked_sub(self.first).filter(|number| *number < self.count)
    }
}

in_turn!(Functions { first, count });

/// Module status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Bit by bit: what the hub has to say.
    pub status: u8,
    /// Bits 0 to 3: that motor lost counts; 4 to 7: its bridge is too hot.
    pub motor_alerts: u8,
}

/// Something about one motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MotorAlert {
    /// 0 to 3.
    pub motor: usize,
    /// What is the matter with it.
    pub says: &'static str,
}

impl fmt::Display for MotorAlert {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "motor {} {}", self.motor, self.says)
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

    /// The status bits from bit 0 on.
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

    /// The status bits in words; none if all is well.
    pub fn words(self) -> Vec<&'static str, 8> {
        let bits = Self::WORDS.iter().enumerate().filter(|(bit, _)| self.status & 1 << bit != 0);
        bits.map(|(_, word)| *word).collect()
    }

    /// The motor alerts one by one.
    pub fn alerts(self) -> Vec<MotorAlert, 8> {
        let of = |first, says| (0..CHANNELS).map(move |motor| (first + motor, MotorAlert { motor, says }));
        let all = of(0, "lost counts").chain(of(4, "bridge too hot"));
        all.filter(|(bit, _)| self.motor_alerts & 1 << bit != 0).map(|(_, alert)| alert).collect()
    }
}

in_turn!(Status { status, motor_alerts });

/// Everything that changes while motors run, in one answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bulk {
    /// Bit i: level of digital input i.
    pub digital: u8,
    /// Counts, by motor.
    pub encoders: [i32; CHANNELS],
    /// More current than its alert allows, by motor.
    pub over_current: [bool; CHANNELS],
    /// True in regulated position while the motor is [within tolerance](crate::motor::within_tolerance), by motor.
    pub within_tolerance: [bool; CHANNELS],
    /// Counts per second, by motor.
    pub velocities: [i16; CHANNELS],
    /// Millivolts.
    pub analog: [i16; CHANNELS],
    /// The module status has something to say; `None` from firmware up to 1.8.2, which does not tell.
    pub attention: Option<bool>,
}

/// 35 bytes, or 34 without the last. The motors' bits are one byte: over-current from bit 0 on, within
/// tolerance from bit 4 on.
impl Field for Bulk {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let (digital, encoders, motors) = (u8::read(fields)?, Field::read(fields)?, u8::read(fields)?);
        let bits = |first: usize| core::array::from_fn(|motor| motors & 1 << (first + motor) != 0);
        Ok(Self {
            digital,
            encoders,
            over_current: bits(0),
            within_tolerance: bits(4),
            velocities: Field::read(fields)?,
            analog: Field::read(fields)?,
            attention: u8::read(fields).ok().map(|byte| byte != 0),
        })
    }

    fn write(&self, payload: &mut Payload) {
        let bits = self.over_current.iter().chain(&self.within_tolerance).enumerate();
        let motors = bits.fold(0, |bits, (bit, is)| bits | u8::from(*is) << bit);
        self.digital.write(payload);
        self.encoders.write(payload);
        motors.write(payload);
        self.velocities.write(payload);
        self.analog.write(payload);
        if let Some(attention) = self.attention {
            attention.write(payload);
        }
    }
}

/// Firmware and hardware. Hosts read from it what a hub understands: from 1.8.2 on, PIDF.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Version {
    pub engineering: u8,
    pub minor: u8,
    pub major: u8,
    pub hardware_minor: u8,
    pub hardware_major: u8,
    /// The type of hub.
    pub hardware: u32,
}

in_turn!(Version { engineering, minor, major, hardware_minor, hardware_major, hardware });
