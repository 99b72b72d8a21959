//! Where a hub is, and how to open a session with it.

use crate::hub::Opened;
use crate::scenario_player::Script;
use crate::world::World;
use motor_hub::protocol::Address;
use std::fmt;

type Opener = Box<dyn FnMut(Option<Address>) -> Result<Opened, String> + Send>;

/// A hub or a chain of hubs, and how to open a session. The function that opens a session gets the address of the hub;
/// `None` for the parent on the line.
pub struct Place {
    pub(crate) name: String,
    pub(crate) world: Option<World>,
    pub(crate) script: Option<Script>,
    /// Address of the hub on its line; `None` for the parent.
    pub(crate) address: Option<Address>,
    pub(crate) open: Opener,
}

impl Place {
    /// A hub on a serial port or TCP connection.
    pub fn real(
        name: &str,
        open: impl FnMut(Option<Address>) -> Result<Opened, String> + Send + 'static,
    ) -> Self {
        Self { name: name.to_owned(), world: None, script: None, address: None, open: Box::new(open) }
    }

    /// A simulated hub. Pages may change its world and play its scenario.
    pub fn simulated(
        name: &str,
        world: World,
        script: Option<Script>,
        open: impl FnMut(Option<Address>) -> Result<Opened, String> + Send + 'static,
    ) -> Self {
        Self { name: name.to_owned(), world: Some(world), script, address: None, open: Box::new(open) }
    }

    /// The hub with this address on the line; `None` for the parent.
    #[must_use]
    pub fn at(self, address: Option<Address>) -> Self {
        Self { address, ..self }
    }
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Place").field("name", &self.name).finish_non_exhaustive()
    }
}
