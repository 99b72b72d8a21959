//! Errors of requests to a hub, and of opening a line.

use crate::request_text::text;
use motor_hub::extension::Request;
use motor_hub::protocol::{BAUD, Nack};
use std::io;

/// Why a request to a hub failed.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// Reading or writing the line failed.
    #[error("{0}")]
    Line(io::Error),
    /// The other end has closed the connection, or the serial port is gone.
    #[error("the connection to the hub has ended")]
    HungUp,
    /// No hub answered a discovery.
    #[error(
        "no hub answers a discovery: check the hub's power, its baud rate ({BAUD}), the port, and that no other host uses the hub"
    )]
    NoHub,
    /// Hubs answered a discovery, but not exactly one of them as parent.
    #[error("{found} hubs answer as parent; exactly one must (addresses that answer: {})", joined(.addresses))]
    Parents {
        /// Number of hubs that answered as parent.
        found: usize,
        /// Addresses of all hubs that answered.
        addresses: Vec<u8>,
    },
    /// The hub answered none of the [`TRANSMISSIONS`](crate::session::TRANSMISSIONS) transmissions of a request.
    #[error(
        "hub {address} does not answer: check its address, its power, its baud rate ({BAUD}), and that no other host uses it"
    )]
    Silent {
        /// The hub's address.
        address: u8,
    },
    /// The hub did not answer a request that is sent once only. The hub may have executed the request.
    #[error(
        "hub {address} does not answer, but may have executed the request to {}: check the device before you repeat the request",
        text(.request)
    )]
    Unconfirmed {
        /// The hub's address.
        address: u8,
        /// The request.
        request: Box<Request>,
    },
    /// The hub answered NACK.
    #[error("the hub refuses to {}: {reason}", text(.request))]
    Refused {
        /// The refused request.
        request: Box<Request>,
        /// The hub's reason.
        reason: Nack,
    },
    /// The answer has another kind or length than the protocol defines for the request.
    #[error("the hub was asked to {}; the protocol does not define its answer", text(.request))]
    Unexpected {
        /// The request.
        request: Box<Request>,
    },
    /// The hub's firmware lacks the function of the request.
    #[error("the hub's firmware is too old to {}", text(.request))]
    TooOld {
        /// The request, which was not sent.
        request: Box<Request>,
    },
}

impl Error {
    /// True if the other end has closed the connection, or the serial port is gone.
    pub const fn is_hung_up(&self) -> bool {
        matches!(self, Self::HungUp)
    }
}

impl From<io::Error> for Error {
    fn from(error: io::Error) -> Self {
        use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset};
        match error.kind() {
            BrokenPipe | ConnectionAborted | ConnectionReset => Self::HungUp,
            _ => Self::Line(error),
        }
    }
}

/// Returns the answer to a request; `None` for [`Error::Refused`] and [`Error::TooOld`]. A hub of another maker, or
/// with older firmware, refuses requests that it does not know.
///
/// # Errors
/// All errors of requests except [`Error::Refused`] and [`Error::TooOld`].
pub fn none_if_unsupported<T>(answer: Result<T, Error>) -> Result<Option<T>, Error> {
    match answer {
        Ok(answer) => Ok(Some(answer)),
        Err(Error::Refused { .. } | Error::TooOld { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Returns the answer to a request; for [`Error::Refused`] the hub's reason as text, as the inner error.
///
/// # Errors
/// All errors of requests except [`Error::Refused`].
pub fn or_reason<T>(answer: Result<T, Error>) -> Result<Result<T, String>, Error> {
    match answer {
        Ok(answer) => Ok(Ok(answer)),
        Err(Error::Refused { reason, .. }) => Ok(Err(reason.to_string())),
        Err(error) => Err(error),
    }
}

fn joined(addresses: &[u8]) -> String {
    addresses.iter().map(u8::to_string).collect::<Vec<_>>().join(", ")
}

/// Why a line could not be opened, or why no hub answered on it.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// The file is not a serial port.
    #[error("is not a serial port")]
    NotASerialPort,
    /// Another program has the serial port open.
    #[error("another program has it open")]
    InUse,
    /// The user has no permission to open the serial port.
    #[error("permission denied")]
    Denied,
    /// The port of a TCP address is out of range.
    #[error("a TCP port is a whole number from 1 to 65535")]
    NotATcpPort,
    /// The host name has no address.
    #[error("no such host")]
    NoSuchHost,
    /// The line is open, but finding the hub failed.
    #[error("{0}")]
    Hub(#[from] Error),
    /// Any other error of the operating system.
    #[error("{0}")]
    System(#[from] io::Error),
}
