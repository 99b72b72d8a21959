//! What can go wrong.
//!
//! ```
//! use motor_hub_client::Error;
//!
//! let error = Error::Silent { address: 2 };
//! assert!(error.to_string().starts_with("hub 2 does not answer; check its address"));
//! ```

use crate::words::words;
use motor_hub::protocol::{BAUD, Nack, Request};
use std::fmt;
use std::io;

/// Why a request has no answer.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The line itself is broken.
    #[error("{0}")]
    Line(#[from] io::Error),
    /// The hub, or what is between, has hung up.
    #[error("the hub has hung up")]
    HungUp,
    /// Nobody answered a discovery.
    #[error(
        "no hub answers a discovery; check its power, its baud rate ({BAUD}), the port, and that no other host talks to it"
    )]
    NoHub,
    /// Hubs answered a discovery, but not one of them as parent.
    #[error("{found} hubs answer as parent, which must be one (those that answer: {addresses})")]
    Parents {
        /// Hubs that say they are parents.
        found: usize,
        /// All that answered.
        addresses: Addresses,
    },
    /// The hub did not answer, however often it was asked.
    #[error(
        "hub {address} does not answer; check its address, its power, its baud rate ({BAUD}), and that no other host talks to it"
    )]
    Silent {
        /// The hub's.
        address: u8,
    },
    /// NACK.
    #[error("the hub refuses to {}: {reason}", words(.request))]
    Refused {
        /// What it was asked to do.
        request: Box<Request>,
        /// Why not.
        reason: Nack,
    },
    /// An answer of another kind or length than the protocol has for the request.
    #[error("the hub was asked to {} and gives an answer that the protocol does not know", words(.request))]
    Unexpected {
        /// What it was asked to do.
        request: Box<Request>,
    },
    /// The hub's firmware has fewer functions.
    #[error("the hub's firmware is too old to {}", words(.request))]
    TooOld {
        /// What it was to be asked to do.
        request: Box<Request>,
    },
}

impl Error {
    /// Whether the other end has closed the connection.
    pub fn is_hung_up(&self) -> bool {
        use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset};
        match self {
            Self::HungUp => true,
            Self::Line(error) => matches!(error.kind(), BrokenPipe | ConnectionAborted | ConnectionReset),
            _ => false,
        }
    }
}

/// Addresses of hubs, shown with commas between.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Addresses(pub Vec<u8>);

impl fmt::Display for Addresses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let addresses: Vec<String> = self.0.iter().map(u8::to_string).collect();
        f.write_str(&addresses.join(", "))
    }
}

/// Why there is no line, or no hub on it.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// A file of another kind.
    #[error("is not a serial port")]
    NotASerialPort,
    /// A serial port is for one program at a time.
    #[error("another program has it open")]
    InUse,
    /// The user may not open it.
    #[error("permission denied")]
    Denied,
    /// No address goes by the name.
    #[error("no such host")]
    NoSuchHost,
    /// There is a line, but no hub that answers as it should.
    #[error("{0}")]
    Hub(#[from] Error),
    /// What the system says.
    #[error("{0}")]
    System(#[from] io::Error),
}
