//! Addresses of hosts and hubs.
//!
//! ```
//! use motor_hub::protocol::{Address, BROADCAST, HOST};
//!
//! assert_eq!(Address::new(7).map(Address::get), Some(7));
//! assert_eq!([HOST, BROADCAST].map(Address::new), [None; 2]);
//! ```

use super::payload::ByteIn;

/// The address of the host.
pub const HOST: u8 = 0;

/// The destination of a packet to all hubs.
pub const BROADCAST: u8 = 255;

/// The address of one hub, which is neither [`HOST`] nor [`BROADCAST`].
pub type Address = ByteIn<1, 254>;

impl Address {
    /// The address of a hub without a stored address, until a host sets an address. Hosts find out the address by
    /// discovery.
    pub const DEFAULT: Self = Self::new(2).expect("1 to 254");
}
