//! The keep-alive timer, and REV's module status. The module status has the *events* that no host has cleared, and
//! tells whether the battery is low.
//!
//! ```text
//!               packet              2.5 s without a packet
//! [Awaited] -----------> [Present] -----------------------> [Lost]
//!     |                      ^             packet             | ^
//!     |                      '--------------------------------' |
//!     '---------------------------------------------------------'
//!                            stop to all hubs
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

use crate::protocol::answers::Status;
use crate::units::Micros;

/// Time in microseconds without a packet for this hub, after which the host counts as lost. REV's hubs use 2.5 s too.
pub const TIMEOUT_MICROS: u64 = 2_500_000;

/// Contact with the host.
#[derive(Clone, Copy, Debug)]
pub(super) enum Contact {
    /// No packet for this hub has arrived since boot, and no stop to all hubs. The timer does not run.
    Awaited,
    /// The last packet arrived at this time. The timer runs.
    Present(Micros),
    /// The timer ran out at this time, or a stop to all hubs came at this time before any packet.
    Lost(Micros),
}

/// Keep-alive timer and module status.
#[derive(Clone, Copy, Debug)]
pub struct KeepAlive {
    contact: Contact,
    /// Events that no host has cleared, as bits of [`Status`].
    events: u8,
    /// True while the battery is low.
    battery_low: bool,
}

impl KeepAlive {
    /// Creates the state after a reset. The reset itself is the first event.
    pub const fn new() -> Self {
        Self { contact: Contact::Awaited, events: Status::RESET, battery_low: false }
    }

    /// Restarts the timer, because a packet for this hub has arrived.
    pub const fn packet(&mut self, now: Micros) {
        self.contact = Contact::Present(now);
    }

    /// True if a packet for this hub, or a stop to all hubs, has arrived since reset.
    pub const fn has_received_packet(&self) -> bool {
        !matches!(self.contact, Contact::Awaited)
    }

    /// Checks the timer. If the timer has run out, the host then counts as lost, an event is added, and the result is
    /// true. The result is then false until the timer runs out again.
    pub fn ran_out(&mut self, now: Micros) -> bool {
        let ran_out = self.deadline().is_some_and(|deadline| deadline <= now);
        if ran_out {
            self.contact = Contact::Lost(now);
            self.events |= Status::KEEP_ALIVE_TIMEOUT;
        }
        ran_out
    }

    /// Returns the time at which the timer runs out. `None` if the timer does not run.
    pub const fn deadline(&self) -> Option<Micros> {
        match self.contact {
            Contact::Present(at) => Some(Micros::new(at.get().saturating_add(TIMEOUT_MICROS))),
            Contact::Awaited | Contact::Lost(_) => None,
        }
    }

    /// Adds the event of a fail-safe that a host has requested. A stop to all hubs is no packet for this hub, but no
    /// button may drive motors after it: a host that was awaited then counts as lost.
    pub const fn fail_safe(&mut self, now: Micros) {
        self.events |= Status::FAIL_SAFE;
        if matches!(self.contact, Contact::Awaited) {
            self.contact = Contact::Lost(now);
        }
    }

    /// Stores whether the battery is low. Adds an event when the battery becomes low.
    pub const fn battery(&mut self, low: bool) {
        if low && !self.battery_low {
            self.events |= Status::BATTERY_LOW;
        }
        self.battery_low = low;
    }

    /// Returns the module status: all events, and the bit of a low battery while the battery is low.
    pub const fn status(&self) -> u8 {
        self.events | if self.battery_low { Status::BATTERY_LOW } else { 0 }
    }

    /// Clears all events. While the battery is low, [`status`](Self::status) still has the bit of a low battery.
    pub const fn clear(&mut self) {
        self.events = 0;
    }

    /// True if there are events that no host has cleared. Hosts call this *attention*.
    pub const fn attention(&self) -> bool {
        self.events != 0
    }

    /// Returns the contact with the host.
    pub(super) const fn contact(&self) -> Contact {
        self.contact
    }

    /// True while the battery is low.
    pub(super) const fn battery_low(&self) -> bool {
        self.battery_low
    }
}

impl Default for KeepAlive {
    fn default() -> Self {
        Self::new()
    }
}
