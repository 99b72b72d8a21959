//! The status LED: the hub's own signs, in the colours that users of Expansion Hubs know, and the
//! colour or pattern that a host sets instead.

use super::fields::{Fields, Nack};
use crate::units::Micros;

/// What an RGB LED shows; 0 is dark, 255 full.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Colour {
    /// Red.
    pub red: u8,
    /// Green.
    pub green: u8,
    /// Blue.
    pub blue: u8,
}

impl Colour {
    /// Dark.
    pub const OFF: Self = Self { red: 0, green: 0, blue: 0 };
    /// Waiting for a host; blinking: the host has been lost.
    pub const BLUE: Self = Self { red: 0, green: 0, blue: 255 };
    /// Talking to a host.
    pub const GREEN: Self = Self { red: 0, green: 255, blue: 0 };
    /// Blinking: the battery is low.
    pub const ORANGE: Self = Self { red: 255, green: 64, blue: 0 };

    /// Red, green, blue.
    pub fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(Self { red: fields.u8()?, green: fields.u8()?, blue: fields.u8()? })
    }
}

/// Steps of a pattern.
pub const STEPS: usize = 16;

/// Half a period of the hub's own blinking.
pub const BLINK_MICROS: u64 = 500_000;

/// The unit of a step's duration.
const STEP_MICROS: u64 = 100_000;

/// One step of a pattern.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Step {
    /// In units of 0.1 s; 0 ends the pattern.
    pub duration: u8,
    /// What is shown.
    pub colour: Colour,
}

/// Up to 16 steps, shown over and over.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pattern([Step; STEPS]);

impl Pattern {
    /// Steps of duration, blue, green, red, until one has no duration, the payload ends or 16 are
    /// read. At least one field must be there, and every step that is begun must be whole.
    pub fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let mut steps = [Step::default(); STEPS];
        for (index, step) in steps.iter_mut().enumerate() {
            if index > 0 && fields.is_empty() {
                break;
            }
            let duration = fields.u8()?;
            if duration == 0 {
                break;
            }
            let (blue, green, red) = (fields.u8()?, fields.u8()?, fields.u8()?);
            *step = Step { duration, colour: Colour { red, green, blue } };
        }
        Ok(Self(steps))
    }

    /// As the host sends it, padded with zeros.
    pub fn bytes(&self) -> [[u8; 4]; STEPS] {
        self.0.map(|Step { duration, colour: Colour { red, green, blue } }| [duration, blue, green, red])
    }

    /// What is shown so long after the start; `None` if the pattern is empty.
    fn at(&self, elapsed: u64) -> Option<Colour> {
        let total: u64 = self.0.iter().map(|step| u64::from(step.duration) * STEP_MICROS).sum();
        let mut left = elapsed.checked_rem(total)?;
        for step in &self.0 {
            let duration = u64::from(step.duration) * STEP_MICROS;
            if left < duration {
                return Some(step.colour);
            }
            left -= duration;
        }
        None
    }
}

/// What the LED stands for when no host says otherwise.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sign {
    /// No packet since boot: blue.
    Waiting,
    /// Packets come: green.
    Talking,
    /// Packets have stopped coming, since then: blinking blue.
    Lost(Micros),
    /// The battery is low: blinking orange.
    BatteryLow,
}

impl Sign {
    fn at(self, now: Micros) -> Colour {
        let blink = |since, colour| {
            if (now.since(since) / BLINK_MICROS).is_multiple_of(2) { colour } else { Colour::OFF }
        };
        match self {
            Self::Waiting => Colour::BLUE,
            Self::Talking => Colour::GREEN,
            Self::Lost(since) => blink(since, Colour::BLUE),
            Self::BatteryLow => blink(Micros::new(0), Colour::ORANGE),
        }
    }
}

/// What hosts have said about the LED.
#[derive(Clone, Copy, Debug, Default)]
pub struct Led {
    colour: Colour,
    pattern: Pattern,
    wish: Wish,
}

#[derive(Clone, Copy, Debug, Default)]
enum Wish {
    #[default]
    None,
    Colour,
    /// Since then.
    Pattern(Micros),
}

impl Led {
    /// A host wants this colour; it ends a pattern.
    pub const fn set_colour(&mut self, colour: Colour) {
        self.colour = colour;
        self.wish = Wish::Colour;
    }

    /// A host wants this pattern, from now on. An empty pattern gives the LED back to the hub.
    pub const fn set_pattern(&mut self, pattern: Pattern, now: Micros) {
        self.pattern = pattern;
        self.wish = Wish::Pattern(now);
    }

    /// The colour last set.
    pub const fn colour(&self) -> Colour {
        self.colour
    }

    /// The pattern last set.
    pub const fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// What the LED shows. A host that has been lost has no say: it is for its user that the hub
    /// blinks then.
    pub fn at(&self, now: Micros, sign: Sign) -> Colour {
        let wish = match self.wish {
            _ if matches!(sign, Sign::Lost(_)) => None,
            Wish::None => None,
            Wish::Colour => Some(self.colour),
            Wish::Pattern(since) => self.pattern.at(now.since(since)),
        };
        wish.unwrap_or_else(|| sign.at(now))
    }
}
