//! The status LED: the hub's own signs in the colours of Expansion Hubs, and the colour or pattern that a host sets instead.
//!
//! ```
//! use motor_hub::protocol::Colour;
//! use motor_hub::responder::led::{Led, Sign};
//! use motor_hub::units::Micros;
//!
//! let mut led = Led::default();
//! assert_eq!(led.at(Micros::new(0), Sign::Connected), Colour::GREEN);
//! led.set_colour(Colour::ORANGE);
//! assert_eq!(led.at(Micros::new(0), Sign::Connected), Colour::ORANGE);
//! // The sign of a lost host replaces the host's colour.
//! assert_eq!(led.at(Micros::new(0), Sign::Lost(Micros::new(0))), Colour::BLUE);
//! ```

use crate::protocol::Colour;
use crate::protocol::led::LedPattern;
use crate::units::Micros;

/// Half a period of a blinking sign.
pub const BLINK_MICROS: u64 = 500_000;

/// Unit of a step's duration.
const STEP_MICROS: u64 = 100_000;

/// A sign of the hub's own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Sign {
    /// Blue: no packet has come since boot.
    Waiting,
    /// Green: packets come.
    Connected,
    /// Blinking blue: the host was lost at this time.
    Lost(Micros),
    /// Blinking orange: the battery is low.
    BatteryLow,
}

impl Sign {
    fn at(self, now: Micros) -> Colour {
        let blink = |since, colour| {
            if (now.since(since) / BLINK_MICROS).is_multiple_of(2) { colour } else { Colour::OFF }
        };
        match self {
            Self::Waiting => Colour::BLUE,
            Self::Connected => Colour::GREEN,
            Self::Lost(since) => blink(since, Colour::BLUE),
            Self::BatteryLow => blink(Micros::new(0), Colour::ORANGE),
        }
    }
}

/// The LED, with the colour and the pattern that a host has set.
#[derive(Clone, Copy, Debug, Default)]
pub struct Led {
    colour: Colour,
    pattern: LedPattern,
    shown: Shown,
}

/// What a host has set last.
#[derive(Clone, Copy, Debug, Default)]
enum Shown {
    #[default]
    None,
    Colour,
    /// The pattern, which began at this time.
    Pattern(Micros),
}

impl Led {
    /// Shows a host's colour, and ends a pattern.
    pub const fn set_colour(&mut self, colour: Colour) {
        self.colour = colour;
        self.shown = Shown::Colour;
    }

    /// Shows a host's pattern from now on. After an empty pattern the LED shows the hub's own signs.
    pub const fn set_pattern(&mut self, pattern: LedPattern, now: Micros) {
        self.pattern = pattern;
        self.shown = Shown::Pattern(now);
    }

    /// The colour last set.
    pub const fn colour(&self) -> Colour {
        self.colour
    }

    /// The pattern last set.
    pub const fn pattern(&self) -> &LedPattern {
        &self.pattern
    }

    /// The colour of the LED. The sign of a lost host replaces what the host has set.
    pub fn at(&self, now: Micros, sign: Sign) -> Colour {
        let colour = match self.shown {
            _ if matches!(sign, Sign::Lost(_)) => None,
            Shown::None => None,
            Shown::Colour => Some(self.colour),
            Shown::Pattern(since) => colour_at(&self.pattern, now.since(since)),
        };
        colour.unwrap_or_else(|| sign.at(now))
    }
}

/// The colour of a pattern after `elapsed` microseconds; `None` if the pattern is empty.
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
