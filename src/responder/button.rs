//! A button on the board, to try motors on the bench while no host is there: all of them turn while it is held.
//!
//! | | |
//! |---|---|
//! | held | 1000 counts/s |
//! | released | standstill; a second later nothing is driven |
//! | pressed while the battery is low or unknown | nothing: as a host may not enable a motor then, nor may the button |
//! | down since power-on, or since the battery was low | nothing, until it is pressed anew |
//! | a host has spoken | nothing until a reset, and what the button began ends at once |
//!
//! ```
//! use motor_hub::motor::Setpoint;
//! use motor_hub::responder::button::{Button, Look};
//! use motor_hub::units::{CountsPerSecond, Micros};
//!
//! let mut button = Button::new();
//! let mut look = |down, ms: u64| {
//!     button.step(Look { down, host_spoke: false, battery_good: true, now: Micros::new(1000 * ms) })
//! };
//! look(false, 0);
//! // It may bounce at first.
//! assert_eq!(look(true, 100), Setpoint::Disabled);
//! assert_eq!(look(true, 120), Setpoint::Velocity(CountsPerSecond::new(1000)));
//! ```

use crate::motor::Setpoint;
use crate::units::{CountsPerSecond, Micros};

/// Down counts once it has lasted so long: contacts bounce for less than half of it. Up counts at once.
pub const DEBOUNCE_MICROS: u64 = 20_000;

/// From release until the bridges are opened.
pub const HOLD_MICROS: u64 = 1_000_000;

/// A NeveRest 60 turns about 2700 counts/s at 12 V without load.
const HELD: Setpoint = Setpoint::Velocity(CountsPerSecond::new(1000));

/// What is to be known at a look at the button.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// The contact is closed.
    pub down: bool,
    /// A host has spoken since reset.
    pub host_spoke: bool,
    /// The battery is known and not low.
    pub battery_good: bool,
    /// The time.
    pub now: Micros,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Contact {
    /// Never seen up: one that is stuck, or held through a reset, starts nothing.
    Stuck,
    Up,
    /// Closed since then, and bouncing perhaps.
    Closing(Micros),
    Down,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    Nothing,
    Turning,
    /// Standing still since then.
    Holding(Micros),
}

/// The button.
#[derive(Clone, Debug)]
pub struct Button {
    contact: Contact,
    doing: Doing,
}

impl Button {
    /// After a reset.
    pub const fn new() -> Self {
        Self { contact: Contact::Stuck, doing: Doing::Nothing }
    }

    /// What all motors are to do. To be asked every 10 ms or so.
    pub fn step(&mut self, look: Look) -> Setpoint {
        let pressed = self.pressed(look.down, look.now);
        self.doing = match self.doing {
            _ if look.host_spoke => Doing::Nothing,
            _ if pressed && look.battery_good => Doing::Turning,
            Doing::Turning if self.contact == Contact::Up => Doing::Holding(look.now),
            Doing::Holding(since) if look.now.since(since) >= HOLD_MICROS => Doing::Nothing,
            doing => doing,
        };
        match self.doing {
            Doing::Nothing => Setpoint::Disabled,
            Doing::Turning => HELD,
            Doing::Holding(_) => Setpoint::Velocity(CountsPerSecond::ZERO),
        }
    }

    /// True once for each press.
    fn pressed(&mut self, down: bool, now: Micros) -> bool {
        let before = self.contact;
        self.contact = match before {
            _ if !down => Contact::Up,
            Contact::Up => Contact::Closing(now),
            Contact::Closing(since) if now.since(since) >= DEBOUNCE_MICROS => Contact::Down,
            contact => contact,
        };
        before != self.contact && self.contact == Contact::Down
    }
}

impl Default for Button {
    fn default() -> Self {
        Self::new()
    }
}
