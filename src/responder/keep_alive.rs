//! The keep-alive timer, and the status word with the events that a host has not read yet.
//!
//! ```text
//!               packet              2.5 s without a packet
//! [Awaited] -----------> [Present] -----------------------> [Lost]
//!                            ^             packet             |
//!                            '--------------------------------'
//! ```
//!
//! ```
//! use motor_hub::responder::keep_alive::{KeepAlive, TIMEOUT_MICROS};
//! use motor_hub::units::Micros;
//!
//! let mut keep_alive = KeepAlive::new();
//! keep_alive.packet(Micros::new(0));
//! assert!(!keep_alive.ran_out(Micros::new(TIMEOUT_MICROS - 1)));
//! assert!(keep_alive.ran_out(Micros::new(TIMEOUT_MICROS)));
//! assert!(keep_alive.attention());
//! ```

use super::led::Sign;
use crate::protocol::answers::Status;
use crate::units::Micros;

/// Time without a packet after which a host counts as lost. REV's hubs use 2.5 s.
pub const TIMEOUT_MICROS: u64 = 2_500_000;

/// Contact with the host.
#[derive(Clone, Copy, Debug, Default)]
enum Contact {
    /// No packet has come since boot, and the timer does not run.
    #[default]
    Awaited,
    /// The last packet came at this time.
    Present(Micros),
    /// The timer ran out at this time.
    Lost(Micros),
}

/// Keep-alive timer and status word.
#[derive(Clone, Copy, Debug)]
pub struct KeepAlive {
    contact: Contact,
    /// Events since a host cleared them.
    events: u8,
    battery_low: bool,
}

impl KeepAlive {
    /// The state after a reset.
    pub const fn new() -> Self {
        Self { contact: Contact::Awaited, events: Status::RESET, battery_low: false }
    }

    /// Restarts the timer, because a valid packet has come.
    pub const fn packet(&mut self, now: Micros) {
        self.contact = Contact::Present(now);
    }

    /// True if a valid packet has come since reset.
    pub const fn host_spoke(&self) -> bool {
        !matches!(self.contact, Contact::Awaited)
    }

    /// True if the timer has just run out. The next call returns false.
    pub fn ran_out(&mut self, now: Micros) -> bool {
        let ran_out = self.deadline().is_some_and(|deadline| deadline <= now);
        if ran_out {
            self.contact = Contact::Lost(now);
            self.events |= Status::KEEP_ALIVE_TIMEOUT;
        }
        ran_out
    }

    /// The time at which the timer runs out; `None` if it does not run.
    pub const fn deadline(&self) -> Option<Micros> {
        match self.contact {
            Contact::Present(at) => Some(Micros::new(at.get().saturating_add(TIMEOUT_MICROS))),
            Contact::Awaited | Contact::Lost(_) => None,
        }
    }

    /// Adds the event that a host has requested fail-safe.
    pub const fn fail_safe(&mut self) {
        self.events |= Status::FAIL_SAFE;
    }

    /// Takes the state of the battery. A battery that becomes low is an event, which a host can clear. A low battery is a
    /// state, which a host cannot clear.
    pub const fn battery(&mut self, low: bool) {
        if low && !self.battery_low {
            self.events |= Status::BATTERY_LOW;
        }
        self.battery_low = low;
    }

    /// The status word.
    pub const fn status(&self) -> u8 {
        self.events | if self.battery_low { Status::BATTERY_LOW } else { 0 }
    }

    /// Clears all events.
    pub const fn clear(&mut self) {
        self.events = 0;
    }

    /// True if there are events that no host has cleared.
    pub const fn attention(&self) -> bool {
        self.events != 0
    }

    /// The sign of the status LED.
    pub const fn status_sign(&self) -> Sign {
        match self.contact {
            Contact::Lost(since) => Sign::Lost(since),
            _ if self.battery_low => Sign::BatteryLow,
            Contact::Present(_) => Sign::Connected,
            Contact::Awaited => Sign::Waiting,
        }
    }
}

impl Default for KeepAlive {
    fn default() -> Self {
        Self::new()
    }
}
