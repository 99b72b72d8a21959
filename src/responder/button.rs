//! A button on the board, to try motors on the bench without a host: all motors turn while the button is held.
//!
//! | | |
//! |---|---|
//! | held | 1000 counts/s |
//! | released | standstill; a second later all bridges open |
//! | pressed while the battery is low or unknown | nothing; a host cannot enable a motor then either |
//! | down since power-on, or since the battery was low | nothing, until the button is released and pressed |
//! | after the first packet of a host | nothing until a reset; motors that the button has started are disabled |
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
//! // The contact may bounce at first.
//! assert_eq!(look(true, 100), Setpoint::Disabled);
//! assert_eq!(look(true, 120), Setpoint::Velocity(CountsPerSecond::new(1000)));
//! ```

use crate::motor::Setpoint;
use crate::units::{CountsPerSecond, Micros};

/// Time for which a contact must be closed before the button counts as pressed. Contacts bounce for less than half of this
/// time. An open contact counts immediately.
pub const DEBOUNCE_MICROS: u64 = 20_000;

/// Time at standstill after a release, before the bridges open.
pub const HOLD_MICROS: u64 = 1_000_000;

/// Set-point while the button is held. A NeveRest 60 turns about 2700 counts/s at 12 V without load.
const HELD: Setpoint = Setpoint::Velocity(CountsPerSecond::new(1000));

/// Inputs of a step.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// True if the contact is closed.
    pub down: bool,
    /// True if a packet has come since reset.
    pub host_spoke: bool,
    /// True if the battery is known and not low.
    pub battery_good: bool,
    /// The time.
    pub now: Micros,
}

/// State of the contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Contact {
    /// Closed since reset: a button that is stuck, or held during a reset.
    Stuck,
    Up,
    /// Closed since this time, and bouncing perhaps.
    Closing(Micros),
    Down,
}

/// What the button makes the motors do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Nothing,
    Turning,
    /// At standstill since this time.
    Holding(Micros),
}

/// The button.
#[derive(Clone, Debug)]
pub struct Button {
    contact: Contact,
    motion: Motion,
}

impl Button {
    /// The button after a reset.
    pub const fn new() -> Self {
        Self { contact: Contact::Stuck, motion: Motion::Nothing }
    }

    /// The set-point of all motors. To be called about every 10 ms.
    pub fn step(&mut self, look: Look) -> Setpoint {
        let pressed = self.pressed(look.down, look.now);
        self.motion = match self.motion {
            _ if look.host_spoke => Motion::Nothing,
            _ if pressed && look.battery_good => Motion::Turning,
            Motion::Turning if self.contact == Contact::Up => Motion::Holding(look.now),
            Motion::Holding(since) if look.now.since(since) >= HOLD_MICROS => Motion::Nothing,
            motion => motion,
        };
        match self.motion {
            Motion::Nothing => Setpoint::Disabled,
            Motion::Turning => HELD,
            Motion::Holding(_) => Setpoint::Velocity(CountsPerSecond::ZERO),
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
