//! The colour of the status LED. A host may set a colour or a pattern. Otherwise the LED shows a *signal* in the
//! colours of REV's Expansion Hubs. The first state of this table that is true decides:
//!
//! | state | signal |
//! |---|---|
//! | the host was lost | blinking blue, also instead of a host's colour or pattern |
//! | the battery is low | blinking orange |
//! | a host is present | green |
//! | no packet has arrived since boot | blue |

use super::keep_alive::{Contact, KeepAlive};
use crate::protocol::Colour;
use crate::protocol::led::LedPattern;
use crate::units::Micros;

/// Half the period of a blinking signal, in microseconds.
const BLINK_MICROS: u64 = 500_000;

/// Unit in which the duration of a pattern's step is stated, in microseconds.
const STEP_MICROS: u64 = 100_000;

/// State of the LED.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Led {
    /// The colour that a host has set last.
    colour: Colour,
    /// The pattern that a host has set last.
    pattern: LedPattern,
    /// Whether the LED shows the colour, the pattern, or a signal.
    shown: Shown,
}

/// What the LED shows at a host's request, unless the host is lost.
#[derive(Clone, Copy, Debug, Default)]
enum Shown {
    /// No host has set a colour or a pattern. The LED shows the hub's signals.
    #[default]
    None,
    /// The LED shows the host's colour.
    Colour,
    /// The LED shows the host's pattern, which began at this time.
    Pattern(Micros),
}

impl Led {
    /// Shows a host's colour, and ends a pattern.
    pub(super) const fn set_colour(&mut self, colour: Colour) {
        self.colour = colour;
        self.shown = Shown::Colour;
    }

    /// Shows a host's pattern, beginning at `now`. An empty pattern makes the LED show the hub's signals again.
    pub(super) const fn set_pattern(&mut self, pattern: LedPattern, now: Micros) {
        self.pattern = pattern;
        self.shown = Shown::Pattern(now);
    }

    /// Returns the colour that a host has set last.
    pub(super) const fn colour(&self) -> Colour {
        self.colour
    }

    /// Returns the pattern that a host has set last.
    pub(super) const fn pattern(&self) -> &LedPattern {
        &self.pattern
    }

    /// Returns the colour of the LED. The signal of a lost host has priority over the host's colour and pattern.
    pub(super) fn at(&self, now: Micros, keep_alive: &KeepAlive) -> Colour {
        let blink = |since, colour| {
            if (now.since(since) / BLINK_MICROS).is_multiple_of(2) { colour } else { Colour::OFF }
        };
        let of_host = match self.shown {
            Shown::None => None,
            Shown::Colour => Some(self.colour),
            Shown::Pattern(since) => colour_at(&self.pattern, now.since(since)),
        };
        match (keep_alive.contact(), of_host) {
            (Contact::Lost(since), _) => blink(since, Colour::BLUE),
            (_, Some(colour)) => colour,
            _ if keep_alive.battery_low() => blink(Micros::new(0), Colour::ORANGE),
            (Contact::Present(_), None) => Colour::GREEN,
            (Contact::Awaited, None) => Colour::BLUE,
        }
    }
}

/// Returns the colour of a pattern `elapsed_us` microseconds after its beginning. `None` if the pattern is empty.
fn colour_at(pattern: &LedPattern, elapsed_us: u64) -> Option<Colour> {
    let total: u64 = pattern.steps().iter().map(|step| u64::from(step.duration) * STEP_MICROS).sum();
    let mut left = elapsed_us.checked_rem(total)?;
    for step in pattern.steps() {
        let duration = u64::from(step.duration) * STEP_MICROS;
        if left < duration {
            return Some(step.colour);
        }
        left -= duration;
    }
    None
}
