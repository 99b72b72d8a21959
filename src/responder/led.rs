//! The status LED: the hub's own signs, in the colours that users of Expansion Hubs know, and the
//! colour or pattern that a host sets instead.
//!
//! ```
//! use motor_hub::protocol::Colour;
//! use motor_hub::responder::led::{Led, Sign};
//! use motor_hub::units::Micros;
//!
//! let mut led = Led::default();
//! assert_eq!(led.at(Micros::new(0), Sign::Talking), Colour::GREEN);
//! led.set_colour(Colour::ORANGE);
//! assert_eq!(led.at(Micros::new(0), Sign::Talking), Colour::ORANGE);
//! // A host that has been lost has no say.
//! assert_eq!(led.at(Micros::new(0), Sign::Lost(Micros::new(0))), Colour::BLUE);
//! ```

use crate::protocol::Colour;
use crate::protocol::led::LedPattern;
use crate::units::Micros;

/// Half a period of the hub's own blinking.
pub const BLINK_MICROS: u64 = 500_000;

/// The unit of a step's duration.
const STEP_MICROS: u64 = 100_000;

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
    pattern: LedPattern,
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
    pub const fn set_pattern(&mut self, pattern: LedPattern, now: Micros) {
        self.pattern = pattern;
        self.wish = Wish::Pattern(now);
    }

    /// The colour last set.
    pub const fn colour(&self) -> Colour {
        self.colour
    }

    /// The pattern last set.
    pub const fn pattern(&self) -> &LedPattern {
        &self.pattern
    }

    /// What the LED shows. A host that has been lost has no say: it is for its user that the hub
    /// blinks then.
    pub fn at(&self, now: Micros, sign: Sign) -> Colour {
        let wish = match self.wish {
            _ if matches!(sign, Sign::Lost(_)) => None,
            Wish::None => None,
            Wish::Colour => Some(self.colour),
            Wish::Pattern(since) => colour_at(&self.pattern, now.since(since)),
        };
        wish.unwrap_or_else(|| sign.at(now))
    }
}

/// What is shown so long after the start; `None` if the pattern is empty.
fn colour_at(pattern: &LedPattern, elapsed: u64) -> Option<Colour> {
    let total: u64 = pattern.steps().iter().map(|step| u64::from(step.duration) * STEP_MICROS).sum();
    let mut left = elapsed.checked_rem(total)?;
    for step in pattern.steps() {
        let duration = u64::from(step.duration) * STEP_MICROS;
        if left < duration {
            return Some(step.colour);
        }
        left -= duration;
    }
    None
}
