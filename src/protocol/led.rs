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
    /// Colour of an RGB LED. Each part is 0 (dark) to 255 (brightest).
    #[derive(Copy, Default)]
    #[expect(missing_docs, reason = "the type describes its fields")]
    pub struct Colour {
        pub red: u8,
        pub green: u8,
        pub blue: u8,
    }
}

impl Colour {
    /// Dark.
    pub const OFF: Self = Self { red: 0, green: 0, blue: 0 };
    /// Colour of a hub that waits for a host. A hub that has lost its host blinks in this colour.
    pub const BLUE: Self = Self { red: 0, green: 0, blue: 255 };
    /// Colour of a hub that is connected to a host.
    pub const GREEN: Self = Self { red: 0, green: 255, blue: 0 };
    /// Colour in which a hub blinks while its battery is low.
    pub const ORANGE: Self = Self { red: 255, green: 64, blue: 0 };
}

/// Largest number of steps in a pattern.
pub const STEPS: usize = 16;

/// One step of a pattern.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Step {
    /// Duration in units of 0.1 s. A step with duration 0 ends the pattern and is not shown.
    pub duration: u8,
    /// Colour during the step.
    pub colour: Colour,
}

/// A pattern of up to 16 steps, which the LED repeats.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct LedPattern([Step; STEPS]);

impl LedPattern {
    /// Creates a pattern of the first 16 steps. A step with duration 0 ends the pattern and is left out.
    pub fn new(steps: &[Step]) -> Self {
        let mut pattern = Self::default();
        let shown = steps.iter().take_while(|step| step.duration > 0);
        pattern.0.iter_mut().zip(shown).for_each(|(step, shown)| *step = *shown);
        pattern
    }

    /// Returns the steps of the pattern. Unused steps at the end have duration 0.
    pub const fn steps(&self) -> &[Step; STEPS] {
        &self.0
    }
}

/// The fields of a step are duration, blue, green and red, in this order.
///
/// Reading ends at a step with duration 0, at the end of the payload, or after 16 steps. The first duration is
/// required, and no step may be incomplete. Writing always writes 16 steps.
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
