//! Why a command to a hub failed.

use crate::output::Failure;
use motor_hub_client::Error;

/// Failure of a command. Errors of the hub are printed with its port.
pub(super) enum ClientError {
    Hub(Error),
    Other(Failure),
}

impl From<Error> for ClientError {
    fn from(error: Error) -> Self {
        Self::Hub(error)
    }
}

impl From<Failure> for ClientError {
    fn from(failure: Failure) -> Self {
        Self::Other(failure)
    }
}
