//! Where a hub is, and how to open a session with it.

use crate::hub::Opened;
use crate::scenario_player::Script;
use crate::world::World;
use motor_hub::protocol::Address;

/// A hub or a chain of hubs, and how to open a session.
pub struct Place {
    /// Name of the port or address.
    pub name: String,
    /// World of a simulated hub, which pages may change; `None` for a real hub.
    pub world: Option<World>,
    /// Scenario of a simulated hub, which pages may play.
    pub script: Option<Script>,
    /// Address of the hub on its line; `None` for the parent.
    pub address: Option<Address>,
    /// Opens a session with the hub at an address; `None` for the parent on the line.
    pub open: Box<dyn FnMut(Option<Address>) -> Result<Opened, String> + Send>,
}

impl Place {
    /// The parent on a real line.
    pub fn new(
        name: &str,
        open: impl FnMut(Option<Address>) -> Result<Opened, String> + Send + 'static,
    ) -> Self {
        Self { name: name.to_owned(), world: None, script: None, address: None, open: Box::new(open) }
    }
}
