//! Layouts of answers.

use super::fields::Nack;
use super::frame::Packet;
use heapless::Vec;

/// The longest payload of a reply: an LED pattern.
pub const LONGEST: usize = 64;

/// Bit 15 of a request's type makes the type of its data response.
const RESPONSE: u16 = 0x8000;

const ACK: u16 = 0x7F01;
const NACK: u16 = 0x7F02;

/// A packet from the hub.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reply {
    /// Who asked.
    pub destination: u8,
    /// The hub.
    pub source: u8,
    /// The hub's own count.
    pub number: u8,
    /// The request's number.
    pub reference: u8,
    /// What it is.
    pub id: u16,
    /// What it says.
    pub payload: Data,
}

/// The payload of a data response.
pub type Data = Vec<u8, LONGEST>;

/// What a request is answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Done.
    Ack,
    /// What was asked for.
    Data(Data),
}

impl Answer {
    /// Data, field by field; what goes beyond [`LONGEST`] is left out, which no layout needs.
    #[inline(never)]
    pub fn data(fields: &[&[u8]]) -> Self {
        let mut data = Data::new();
        for field in fields {
            let _ = data.extend_from_slice(field);
        }
        Self::Data(data)
    }
}

impl Reply {
    /// The reply to `request`. `attention` asks the host to read the module status.
    pub fn to(
        request: &Packet,
        source: u8,
        number: u8,
        attention: bool,
        answer: Result<Answer, Nack>,
    ) -> Self {
        let (id, payload) = match answer {
            Ok(Answer::Ack) => (ACK, one(u8::from(attention))),
            Ok(Answer::Data(data)) => (request.id | RESPONSE, data),
            Err(nack) => (NACK, one(nack.code())),
        };
        Self { destination: request.source, source, number, reference: request.number, id, payload }
    }
}

fn one(byte: u8) -> Data {
    let mut data = Data::new();
    let _ = data.push(byte);
    data
}

/// Everything that changes while motors run, in one answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bulk {
    /// Bit i: level of digital input i.
    pub digital: u8,
    /// Counts.
    pub encoders: [i32; super::CHANNELS],
    /// Bits 0 to 3: over-current of motor 0 to 3; bits 4 to 7: at target.
    pub motor_status: u8,
    /// Counts per second.
    pub velocities: [i16; super::CHANNELS],
    /// Millivolts.
    pub analog: [i16; super::CHANNELS],
    /// The module status has something to say.
    pub attention: bool,
}

impl Bulk {
    /// 35 bytes.
    pub fn answer(&self) -> Answer {
        Answer::data(&[
            &[self.digital],
            self.encoders.map(i32::to_le_bytes).as_flattened(),
            &[self.motor_status],
            self.velocities.map(i16::to_le_bytes).as_flattened(),
            self.analog.map(i16::to_le_bytes).as_flattened(),
            &[u8::from(self.attention)],
        ])
    }
}
