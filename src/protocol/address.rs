//! Addresses of hosts and hubs.
//!
//! ```
//! use motor_hub::protocol::{Address, BROADCAST, HOST};
//!
//! assert_eq!(Address::new(7).map(Address::get), Some(7));
//! assert_eq!([HOST, BROADCAST].map(Address::new), [None; 2]);
//! ```

use super::payload::{Field, Fields, Payload};
use super::refusal::Nack;

/// The address of the host.
pub const HOST: u8 = 0;

/// The destination of a packet to every hub.
pub const BROADCAST: u8 = 255;

/// A hub's address, 1 to 254.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Address(u8);

impl Address {
    /// The address of a hub until a host sets another: 2. Hosts find the address by discovery.
    pub const DEFAULT: Self = Self(2);

    /// The address; `None` for 0, which is the host, and for 255, which is every hub.
    pub const fn new(address: u8) -> Option<Self> {
        if address == HOST || address == BROADCAST { None } else { Some(Self(address)) }
    }

    /// The address as a number, 1 to 254.
    pub const fn get(self) -> u8 {
        self.0
    }
}

impl Default for Address {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Field for Address {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        fields.checked(Self::new)
    }

    fn write(&self, payload: &mut Payload) {
        self.0.write(payload);
    }
}
