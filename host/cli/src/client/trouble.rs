//! Why a command to a hub failed.

use crate::output::Failure;
use motor_hub_client::Error;

/// Why a command did not do what it was asked; what the hub is to blame for is told with its port.
pub(super) enum Trouble {
    Hub(Error),
    Other(Failure),
}

impl From<Error> for Trouble {
    fn from(error: Error) -> Self {
        Self::Hub(error)
    }
}

impl From<Failure> for Trouble {
    fn from(failure: Failure) -> Self {
        Self::Other(failure)
    }
}
