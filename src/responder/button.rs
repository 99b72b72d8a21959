//! A button on the board, to try motors on the bench without a host. All motors turn while the button is pressed.
//!
//! | button | motors |
//! |---|---|
//! | pressed | turn at 1000 counts/s |
//! | released | are regulated to standstill for a second, then all bridges open |
//! | pressed while the battery is low or unknown | no effect |
//! | pressed since before the reset, or since the battery was low | no effect until it is released and pressed again |
//! | pressed after a host has sent a packet | no effect until a reset |
//! | pressed before the stored settings are restored | no effect until the button is released and pressed again |
//!
//! The first packet of a host disables motors that the button has started.
//!
//! ```
//! use motor_hub::motor::Setpoint;
//! use motor_hub::responder::button::{Button, ButtonInputs};
//! use motor_hub::units::{CountsPerSecond, Micros};
//!
//! let mut button = Button::default();
//! let mut step = |down, ms: u64| {
//!     button.step(ButtonInputs { down, permitted: true, battery_good: true, now: Micros::new(1000 * ms) })
//! };
//! step(false, 0);
//! // The contact may bounce at first.
//! assert_eq!(step(true, 100), Setpoint::Disabled);
//! assert_eq!(step(true, 120), Setpoint::Velocity(CountsPerSecond::new(1000)));
//! ```

use crate::motor::Setpoint;
use crate::units::{CountsPerSecond, Micros};

/// Time in microseconds for which the contact must be closed before the button counts as pressed.
///
/// Contacts bounce for less than half of this time. A contact that opens releases the button immediately.
pub const DEBOUNCE_MICROS: u64 = 20_000;

/// Time in microseconds for which motors are regulated to standstill after the button is released.
pub const HOLD_MICROS: u64 = 1_000_000;

/// Set-point while the button is pressed. A NeveRest 60 without load turns about 2700 counts/s at 12 V.
const TURN: Setpoint = Setpoint::Velocity(CountsPerSecond::new(1000));

/// Inputs of a step.
#[derive(Clone, Copy, Debug)]
pub struct ButtonInputs {
    /// True if the contact is closed.
    pub down: bool,
    /// True if no host has sent a packet since reset, and the stored settings are restored.
    pub permitted: bool,
    /// True if the battery voltage is known and not low.
    pub battery_good: bool,
    /// Present time.
    pub now: Micros,
}

/// State of the contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum ContactState {
    Open,
    /// Closed since this time, which is less than [`DEBOUNCE_MICROS`] ago. The contact may still bounce.
    Closing(Micros),
    /// Closed for at least [`DEBOUNCE_MICROS`], or since reset. Also the state before the first step.
    #[default]
    Closed,
}

/// What the button commands the motors to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum ButtonMotion {
    /// The motors are disabled.
    #[default]
    Off,
    /// The motors turn, because the button is pressed.
    Turning,
    /// The button was released at this time, and the motors are regulated to standstill.
    Stopping(Micros),
}

/// State of the button and its motors. The default is the state after a reset.
#[derive(Clone, Debug, Default)]
pub struct Button {
    contact: ContactState,
    motion: ButtonMotion,
}

impl Button {
    /// Returns the set-point of all motors. Must be called about every 10 ms.
    pub fn step(&mut self, inputs: ButtonInputs) -> Setpoint {
        let pressed = self.pressed(inputs.down, inputs.now);
        self.motion = match self.motion {
            _ if !inputs.permitted => ButtonMotion::Off,
            _ if pressed && inputs.battery_good => ButtonMotion::Turning,
            ButtonMotion::Turning if self.contact == ContactState::Open => ButtonMotion::Stopping(inputs.now),
            ButtonMotion::Stopping(since) if inputs.now.since(since) >= HOLD_MICROS => ButtonMotion::Off,
            motion => motion,
        };
        match self.motion {
            ButtonMotion::Off => Setpoint::Disabled,
            ButtonMotion::Turning => TURN,
            ButtonMotion::Stopping(_) => Setpoint::Velocity(CountsPerSecond::ZERO),
        }
    }

    /// Updates the contact. Returns true once for each press, when the contact has been closed for [`DEBOUNCE_MICROS`].
    fn pressed(&mut self, down: bool, now: Micros) -> bool {
        let before = self.contact;
        self.contact = match before {
            _ if !down => ContactState::Open,
            ContactState::Open => ContactState::Closing(now),
            ContactState::Closing(since) if now.since(since) >= DEBOUNCE_MICROS => ContactState::Closed,
            contact => contact,
        };
        before != self.contact && self.contact == ContactState::Closed
    }
}
