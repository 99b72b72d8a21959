//! Digital pins, PWM and servo outputs. A motor hub has none, but host software sets them up when it
//! opens a hub: what is set is remembered and read back, and moves nothing. Inputs read 0.

use super::fields::{Fields, Nack};
use super::reply::Answer;

/// Digital pins.
const PINS: usize = 8;
/// Outputs of each kind.
const PWM: usize = 4;
const SERVOS: usize = 6;

/// A kind of pulsed output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the names say it")]
pub enum Kind {
    Pwm,
    Servo,
}

/// What there is to say about a pulsed output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Item {
    /// In microseconds.
    Period,
    /// Of a pulse, in microseconds.
    Width,
    /// 0 or 1.
    Enable,
}

/// A request to a pin or a pulsed output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "each is named as the protocol names it")]
pub enum Pins {
    SetOutput { pin: usize, high: bool },
    SetOutputs(u8),
    SetDirection { pin: usize, output: bool },
    Direction { pin: usize },
    Input { pin: usize },
    Inputs,
    Set { kind: Kind, channel: usize, item: Item, value: u16 },
    Get { kind: Kind, channel: usize, item: Item },
}

/// Functions 1 to 6 and 25 to 36.
pub fn read(number: u16, fields: &mut Fields<'_>) -> Result<Pins, Nack> {
    Ok(match number {
        1 => Pins::SetOutput { pin: fields.index(PINS)?, high: fields.flag()? },
        2 => Pins::SetOutputs(fields.u8()?),
        3 => Pins::SetDirection { pin: fields.index(PINS)?, output: fields.flag()? },
        4 => Pins::Direction { pin: fields.index(PINS)? },
        5 => Pins::Input { pin: fields.index(PINS)? },
        6 => Pins::Inputs,
        25..=30 => pulses(Kind::Pwm, number - 25, fields)?,
        31..=36 => pulses(Kind::Servo, number - 31, fields)?,
        _ => return Err(Nack::Unsupported),
    })
}

/// Set and get in turn, of period, width and enable.
fn pulses(kind: Kind, number: u16, fields: &mut Fields<'_>) -> Result<Pins, Nack> {
    let (channels, least_period, least_width) = match kind {
        Kind::Pwm => (PWM, 0, 0),
        Kind::Servo => (SERVOS, 2, 1),
    };
    let channel = fields.index(channels)?;
    let item = match number / 2 {
        0 => Item::Period,
        1 => Item::Width,
        _ => Item::Enable,
    };
    if number % 2 == 1 {
        return Ok(Pins::Get { kind, channel, item });
    }
    let value = match item {
        Item::Period => fields.u16_from(least_period)?,
        Item::Width => fields.u16_from(least_width)?,
        Item::Enable => u16::from(fields.flag()?),
    };
    Ok(Pins::Set { kind, channel, item, value })
}

#[derive(Clone, Copy, Debug, Default)]
struct Pulses {
    period: u16,
    width: u16,
    enable: u16,
}

impl Pulses {
    const fn item(&mut self, item: Item) -> &mut u16 {
        match item {
            Item::Period => &mut self.period,
            Item::Width => &mut self.width,
            Item::Enable => &mut self.enable,
        }
    }
}

/// What has been set.
#[derive(Clone, Copy, Debug, Default)]
pub struct Memory {
    /// Bit i: pin i is an output.
    outputs: u8,
    /// Bit i: output i is high. Nothing reads it back.
    levels: u8,
    pwm: [Pulses; PWM],
    servos: [Pulses; SERVOS],
}

impl Memory {
    /// Does what a request says.
    pub fn receive(&mut self, request: Pins) -> Result<Answer, Nack> {
        match request {
            Pins::SetOutput { pin, high } => set_bit(&mut self.levels, pin, high),
            Pins::SetOutputs(levels) => self.levels = levels,
            Pins::SetDirection { pin, output } => set_bit(&mut self.outputs, pin, output),
            Pins::Direction { pin } => {
                return Ok(Answer::data(&[&[u8::from(self.outputs & 1u8.wrapping_shl(pin as u32) != 0)]]));
            }
            Pins::Input { .. } | Pins::Inputs => return Ok(Answer::data(&[&[0]])),
            Pins::Set { kind, channel, item, value } => *self.pulses(kind, channel)?.item(item) = value,
            Pins::Get { kind, channel, item } => {
                let value = *self.pulses(kind, channel)?.item(item);
                let [low, high] = value.to_le_bytes();
                let enable = item == Item::Enable;
                return Ok(if enable { Answer::data(&[&[low]]) } else { Answer::data(&[&[low, high]]) });
            }
        }
        Ok(Answer::Ack)
    }

    fn pulses(&mut self, kind: Kind, channel: usize) -> Result<&mut Pulses, Nack> {
        match kind {
            Kind::Pwm => self.pwm.get_mut(channel),
            Kind::Servo => self.servos.get_mut(channel),
        }
        .ok_or(Nack::Parameter(0))
    }

    /// Fail-safe: nothing is enabled.
    pub fn disable(&mut self) {
        for pulses in self.pwm.iter_mut().chain(&mut self.servos) {
            pulses.enable = 0;
        }
    }
}

/// `pin` is below 8.
const fn set_bit(bits: &mut u8, pin: usize, to: bool) {
    let bit = 1u8.wrapping_shl(pin as u32);
    *bits = if to { *bits | bit } else { *bits & !bit };
}
