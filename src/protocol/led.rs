//! What a host makes the status LED show.
//!
//! ```
//! use motor_hub::protocol::fields::{Field, Fields, Payload};
//! use motor_hub::protocol::led::{Colour, LedPattern, Step};
//!
//! let blinking = LedPattern::new(&[
//!     Step { duration: 5, colour: Colour::GREEN },
//!     Step { duration: 5, colour: Colour::OFF },
//! ]);
//! let mut payload = Payload::new();
//! blinking.write(&mut payload);
//! assert_eq!(payload[..8], [5, 0, 255, 0, 5, 0, 0, 0]);
//! assert_eq!(LedPattern::read(&mut Fields::new(&payload)), Ok(blinking));
//! ```

use super::fields::{Field, Fields, Payload};
use super::nack::Nack;

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
}

/// Red, green, blue.
impl Field for Colour {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let [red, green, blue] = Field::read(fields)?;
        Ok(Self { red, green, blue })
    }

    fn write(&self, payload: &mut Payload) {
        let Self { red, green, blue } = *self;
        [red, green, blue].write(payload);
    }
}

/// The most steps of a pattern.
pub const STEPS: usize = 16;

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
pub struct LedPattern([Step; STEPS]);

impl LedPattern {
    /// The first 16 steps, or those before one without a duration.
    pub fn new(steps: &[Step]) -> Self {
        let mut pattern = Self::default();
        let shown = steps.iter().take_while(|step| step.duration > 0);
        pattern.0.iter_mut().zip(shown).for_each(|(step, shown)| *step = *shown);
        pattern
    }

    /// Padded with steps that have no duration.
    pub const fn steps(&self) -> &[Step; STEPS] {
        &self.0
    }
}

/// Steps of duration, blue, green, red: on reading until one has no duration, the payload ends or 16
/// are read. At least one field must be there, and every step that is begun must be whole. 16 are
/// written.
impl Field for LedPattern {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let mut pattern = Self::default();
        for (index, step) in pattern.0.iter_mut().enumerate() {
            if index > 0 && fields.is_empty() {
                break;
            }
            let duration = u8::read(fields)?;
            if duration == 0 {
                break;
            }
            let [blue, green, red] = Field::read(fields)?;
            *step = Step { duration, colour: Colour { red, green, blue } };
        }
        Ok(pattern)
    }

    fn write(&self, payload: &mut Payload) {
        for Step { duration, colour: Colour { red, green, blue } } in self.0 {
            [duration, blue, green, red].write(payload);
        }
    }
}
