//! The host's end of the REV Hub Serial Protocol: a session with one real or simulated hub.
//!
//! ```text
//! cli::client --> [hub] --request--> [session] --bytes--> line
//!             <--answer--        <--Packet--
//! ```
//!
//! | room | what is decided there |
//! |---|---|
//! | [`mod@line`] | serial port or TCP connection, as bytes with timeouts |
//! | [`wire`] | requests as bytes; which packet answers them, and what a refusal means |
//! | [`session`] | one request at a time: waiting, trying again, discovery |
//! | [`hub`], [`motor`] | the protocol's commands with their types |
//! | [`state`] | what a hub says of itself: bulk input, module status |

pub mod hub;
pub mod line;
pub mod motor;
pub mod session;
pub mod state;
pub mod wire;

pub use session::Session;

/// Why a request has no answer.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The line itself is broken.
    #[error("{0}")]
    Line(#[from] std::io::Error),
    /// Nobody answered a discovery.
    #[error(
        "no hub answers a discovery; check its power, its baud rate (460800), the port, and that no other host talks to it"
    )]
    NoHub,
    /// Hubs answered a discovery, but not one of them as parent.
    #[error("{found} hubs answer as parent, which must be one; name one by --address ({addresses})")]
    Parents {
        /// Hubs that say they are parents.
        found: usize,
        /// All that answered.
        addresses: String,
    },
    /// The hub did not answer, however often it was asked.
    #[error(
        "hub {address} does not answer; check its address, its power, its baud rate (460800), and that no other host talks to it"
    )]
    Silent {
        /// The hub's.
        address: u8,
    },
    /// NACK.
    #[error("the hub refuses to {what}: {reason}")]
    Refused {
        /// What it was asked to do.
        what: String,
        /// Why not.
        reason: wire::Refusal,
    },
    /// An answer of another kind or length than the protocol has for the request.
    #[error("the hub was asked to {what} and gives an answer that the protocol does not know")]
    Unexpected {
        /// What it was asked to do.
        what: String,
    },
    /// The hub's firmware has fewer functions.
    #[error("the hub's firmware is too old to {what}")]
    TooOld {
        /// What it was to be asked to do.
        what: String,
    },
}
