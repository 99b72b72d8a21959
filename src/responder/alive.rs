//! Whether the host is still there, and the status word that tells it what it has missed.
//!
//! ```
//! use motor_hub::responder::alive::{Alive, TIMEOUT_MICROS};
//! use motor_hub::units::Micros;
//!
//! let mut alive = Alive::new();
//! alive.heard(Micros::new(0));
//! assert!(!alive.ran_out(Micros::new(TIMEOUT_MICROS - 1)));
//! assert!(alive.ran_out(Micros::new(TIMEOUT_MICROS)));
//! assert!(alive.attention());
//! ```

use super::led::Sign;
use crate::protocol::answers::Status;
use crate::units::Micros;

/// A host that has said nothing for so long is gone.
pub const TIMEOUT_MICROS: u64 = 2_500_000;

#[derive(Clone, Copy, Debug, Default)]
enum Contact {
    /// Nothing has been heard since boot: the timer stands.
    #[default]
    Awaited,
    /// The last packet came then.
    Heard(Micros),
    /// The timer ran out then.
    Lost(Micros),
}

/// Keep-alive timer and status word.
#[derive(Clone, Copy, Debug)]
pub struct Alive {
    contact: Contact,
    /// Events since the host last cleared them.
    events: u8,
    battery_low: bool,
}

impl Alive {
    /// After a reset.
    pub const fn new() -> Self {
        Self { contact: Contact::Awaited, events: Status::RESET, battery_low: false }
    }

    /// A valid packet came.
    pub const fn heard(&mut self, now: Micros) {
        self.contact = Contact::Heard(now);
    }

    /// A valid packet has come since reset.
    pub const fn host_spoke(&self) -> bool {
        !matches!(self.contact, Contact::Awaited)
    }

    /// True if the timer has just run out: once for each silence.
    pub fn ran_out(&mut self, now: Micros) -> bool {
        let ran_out = self.deadline().is_some_and(|deadline| deadline <= now);
        if ran_out {
            self.contact = Contact::Lost(now);
            self.events |= Status::KEEP_ALIVE_TIMEOUT;
        }
        ran_out
    }

    /// When the timer runs out, if it runs.
    pub const fn deadline(&self) -> Option<Micros> {
        match self.contact {
            Contact::Heard(at) => Some(Micros::new(at.get().saturating_add(TIMEOUT_MICROS))),
            Contact::Awaited | Contact::Lost(_) => None,
        }
    }

    /// A host asked for fail-safe.
    pub const fn fail_safe(&mut self) {
        self.events |= Status::FAIL_SAFE;
    }

    /// The battery is low, or not. Becoming low is an event; being low is a state that no host can
    /// clear.
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

    /// The host knows.
    pub const fn clear(&mut self) {
        self.events = 0;
    }

    /// True if something has happened that the host has not cleared.
    pub const fn attention(&self) -> bool {
        self.events != 0
    }

    /// What the status LED is to say.
    pub const fn sign(&self) -> Sign {
        match self.contact {
            Contact::Lost(since) => Sign::Lost(since),
            _ if self.battery_low => Sign::BatteryLow,
            Contact::Heard(_) => Sign::Talking,
            Contact::Awaited => Sign::Waiting,
        }
    }
}

impl Default for Alive {
    fn default() -> Self {
        Self::new()
    }
}
