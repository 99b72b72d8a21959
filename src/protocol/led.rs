//! Colours and patterns of the status LED.
//!
//! ```
//! use motor_hub::protocol::payload::{Field, Fields, Payload};
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

use super::payload::{Field, Fields, Payload, payload};
use super::refusal::Nack;

payload! {
    /// Colour of an RGB LED; 0 is dark, 255 is full.
    #[derive(Copy, Default)]
    pub struct Colour {
        /// Red part.
        pub red: u8,
        /// Green part.
        pub green: u8,
        /// Blue part.
        pub blue: u8,
    }
}

impl Colour {
    /// The LED is dark.
    pub const OFF: Self = Self { red: 0, green: 0, blue: 0 };
    /// The hub waits for a host; blinking if the host is lost.
    pub const BLUE: Self = Self { red: 0, green: 0, blue: 255 };
    /// A host is connected.
    pub const GREEN: Self = Self { red: 0, green: 255, blue: 0 };
    /// The battery is low; blinking.
    pub const ORANGE: Self = Self { red: 255, green: 64, blue: 0 };
}

/// The most steps of a pattern.
pub const STEPS: usize = 16;

/// One step of a pattern.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Step {
    /// Duration in units of 0.1 s; 0 ends the pattern.
    pub duration: u8,
    /// Colour during the step.
    pub colour: Colour,
}

/// Up to 16 steps, which the LED repeats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LedPattern([Step; STEPS]);

impl LedPattern {
    /// A pattern of the steps before the first step without a duration, 16 at most.
    pub fn new(steps: &[Step]) -> Self {
        let mut pattern = Self::default();
        let shown = steps.iter().take_while(|step| step.duration > 0);
        pattern.0.iter_mut().zip(shown).for_each(|(step, shown)| *step = *shown);
        pattern
    }

    /// The steps of the pattern, and then steps without a duration.
    pub const fn steps(&self) -> &[Step; STEPS] {
        &self.0
    }
}

/// The fields of a step are duration, blue, green and red. Reading ends at a step without a duration, at the end of the payload,
/// or after 16 steps; the first duration is required, and every step must be complete. Writing writes 16 steps.
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
