//! What a hub says of itself: bulk input and module status.

use motor_hub::link::fields::Fields;
use motor_hub::link::{CHANNELS, Nack};

/// Everything that changes while motors run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Bulk {
    /// Counts, by motor.
    pub encoders: [i32; CHANNELS],
    /// Counts per second, by motor.
    pub velocities: [i16; CHANNELS],
    /// In regulated position and within the tolerance, by motor.
    pub at_target: [bool; CHANNELS],
    /// The module status has something to say; `None` from firmware that does not tell.
    pub attention: Option<bool>,
}

impl Bulk {
    /// From 35 bytes, or 34 of older firmware.
    ///
    /// # Errors
    /// There are fewer.
    pub fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let mut bulk = Self::default();
        let _digital = fields.u8()?;
        for encoder in &mut bulk.encoders {
            *encoder = fields.i32()?;
        }
        let motor_status = fields.u8()?;
        for velocity in &mut bulk.velocities {
            *velocity = fields.i16()?;
        }
        let _analog = fields.slice(2 * CHANNELS)?;
        bulk.attention = fields.u8().ok().map(|byte| byte != 0);
        bulk.at_target = core::array::from_fn(|motor| motor_status & 0x10 << motor != 0);
        Ok(bulk)
    }
}

/// Module status.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Status {
    /// Bit by bit, as in [`WORDS`].
    pub status: u8,
    /// Bits 0 to 3: that motor lost counts; 4 to 7: its bridge is too hot.
    pub alerts: u8,
}

/// The status word's bits from bit 0 on.
pub const WORDS: [&str; 8] = [
    "keep-alive timeout",
    "device reset",
    "fail-safe",
    "controller too hot",
    "battery low",
    "interface board fault",
    "bit 6",
    "bit 7",
];

impl Status {
    /// Two bytes.
    ///
    /// # Errors
    /// There are fewer.
    pub fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(Self { status: fields.u8()?, alerts: fields.u8()? })
    }

    /// The status word in words; none if all is well.
    pub fn words(self) -> Vec<&'static str> {
        let bits = WORDS.iter().enumerate().filter(|(bit, _)| self.status & 1 << bit != 0);
        bits.map(|(_, word)| *word).collect()
    }

    /// The motor alerts in words.
    pub fn alert_words(self) -> Vec<String> {
        let mut words = Vec::new();
        for (first, says) in [(0, "lost counts"), (4, "bridge too hot")] {
            let bits = (0..CHANNELS).filter(|motor| self.alerts & 1 << (first + motor) != 0);
            words.extend(bits.map(|motor| format!("motor {motor} {says}")));
        }
        words
    }
}
