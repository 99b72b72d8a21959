//! Where a hub is, and how to open a session with it.

use crate::hub::Opened;
use crate::scenario_player::Script;
use crate::world::World;
use std::fmt;

type Opener = Box<dyn FnMut() -> Result<Opened, String> + Send>;

/// A hub or a chain of hubs, and how to open a session.
pub struct Place {
    pub(crate) name: String,
    pub(crate) world: Option<World>,
    pub(crate) script: Option<Script>,
    pub(crate) open: Opener,
}

impl Place {
    /// A hub on a serial port or TCP connection.
    pub fn real(name: &str, open: impl FnMut() -> Result<Opened, String> + Send + 'static) -> Self {
        Self { name: name.to_owned(), world: None, script: None, open: Box::new(open) }
    }

    /// A simulated hub. Pages may change its world and play its scenario.
    pub fn simulated(
        name: &str,
        world: World,
        script: Option<Script>,
        open: impl FnMut() -> Result<Opened, String> + Send + 'static,
    ) -> Self {
        Self { name: name.to_owned(), world: Some(world), script, open: Box::new(open) }
    }
}

impl fmt::Debug for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Place").field("name", &self.name).finish_non_exhaustive()
    }
}
