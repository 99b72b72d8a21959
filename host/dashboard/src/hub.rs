//! A session with a hub, and errors of its requests.

#[cfg(feature = "server")]
use motor_hub::protocol::Address;
use motor_hub_client::kept_settings::ImportError;
use motor_hub_client::{Error, Session};
use std::fmt;
use std::io::{Read, Write};

/// Bytes to and from a hub. A read without bytes fails soon as `WouldBlock` or `TimedOut`.
pub trait Port: Read + Write + Send + fmt::Debug {}

impl<T: Read + Write + Send + fmt::Debug> Port for T {}

/// A session with a hub on any kind of line.
pub type Hub = Session<Box<dyn Port>>;

/// Opens a session with a hub at `HOST:PORT` or on a serial port, as [`Session::open`]: with the hub that has this address, or
/// with the parent.
///
/// # Errors
/// The line cannot be opened, or without an address not exactly one hub answers as parent.
#[cfg(feature = "server")]
pub fn open(place: &str, address: Option<Address>) -> Result<Hub, motor_hub_client::OpenError> {
    /// Time-out of answers.
    const TIMEOUT: std::time::Duration = std::time::Duration::from_secs(1);
    let line: Box<dyn Port> = Box::new(motor_hub_client::Line::open(place, TIMEOUT)?);
    Ok(match address {
        Some(address) => Session::new(line, address, TIMEOUT),
        None => Session::with_parent(line, TIMEOUT)?,
    })
}

/// Why an order was not executed.
#[derive(Debug)]
pub(crate) enum RequestError {
    /// The server or the hub refuses the order.
    Refused(String),
    /// The exchange with the hub failed; the hub may be gone.
    Hub(Error),
}

impl fmt::Display for RequestError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Refused(why) => f.write_str(why),
            Self::Hub(error) => error.fmt(f),
        }
    }
}

impl From<String> for RequestError {
    fn from(why: String) -> Self {
        Self::Refused(why)
    }
}

impl From<&str> for RequestError {
    fn from(why: &str) -> Self {
        Self::Refused(why.to_owned())
    }
}

impl From<Error> for RequestError {
    fn from(error: Error) -> Self {
        match error {
            Error::Refused { .. } | Error::TooOld { .. } | Error::Unexpected { .. } => {
                Self::Refused(error.to_string())
            }
            error => Self::Hub(error),
        }
    }
}

impl From<ImportError> for RequestError {
    fn from(error: ImportError) -> Self {
        match error {
            ImportError::Lost(error) => error.into(),
            refused @ ImportError::Refused { .. } => Self::Refused(refused.to_string()),
        }
    }
}
