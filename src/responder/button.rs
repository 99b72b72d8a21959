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

/// State of the contact. While it is `Pressed`, the motors turn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum ContactState {
    Open,
    /// Closed since this time, which is less than [`DEBOUNCE_MICROS`] ago. The contact may still bounce.
    Closing(Micros),
    /// Closed without effect until it opens. Also the state before the first step.
    #[default]
    Ignored,
    /// Closed: the button is pressed, and the motors turn.
    Pressed,
}

/// State of the button and its motors. The default is the state after a reset.
#[derive(Clone, Debug, Default)]
pub struct Button {
    contact: ContactState,
    /// Time of the release after which motors are regulated to standstill; `None` if they are not.
    released_at: Option<Micros>,
}

impl Button {
    /// Returns the set-point of all motors. Must be called about every 10 ms.
    pub fn step(&mut self, inputs: ButtonInputs) -> Setpoint {
        let ButtonInputs { down, permitted, battery_good, now } = inputs;
        let was_pressed = self.contact == ContactState::Pressed;
        self.contact = match self.contact {
            _ if !down => ContactState::Open,
            ContactState::Open => ContactState::Closing(now),
            ContactState::Closing(since) if now.since(since) < DEBOUNCE_MICROS => {
                ContactState::Closing(since)
            }
            ContactState::Closing(_) if permitted && battery_good => ContactState::Pressed,
            ContactState::Pressed if permitted => ContactState::Pressed,
            _ => ContactState::Ignored,
        };
        if !permitted {
            self.released_at = None;
        } else if was_pressed && !down {
            self.released_at = Some(now);
        }
        self.released_at.take_if(|released_at| now.since(*released_at) >= HOLD_MICROS);
        match self.contact {
            ContactState::Pressed => TURN,
            _ if self.released_at.is_some() => Setpoint::Velocity(CountsPerSecond::ZERO),
            _ => Setpoint::Disabled,
        }
    }
}
