//! A line to hosts that come and go: to the hub it is a serial line that never ends.

use super::tcp::Tcp;
use super::wire::Wire;
use std::fmt;
use std::io::{Read, Write};

#[cfg(unix)]
use super::pty::Pty;

/// Why a line cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// The system has no pseudo-terminal to give.
    #[error("no pseudo-terminal: {0}")]
    NoPty(std::io::Error),
    /// Systems other than Unix have none at all.
    #[error("this system has no pseudo-terminals")]
    NoPtys,
    /// The address cannot be listened to.
    #[error("{address} cannot be listened to: {error}")]
    Tcp {
        /// As it was given.
        address: String,
        /// Why not.
        error: std::io::Error,
    },
}

/// A line on which nothing waits.
#[derive(Debug)]
pub struct Line(Kind);

#[derive(Debug)]
enum Kind {
    #[cfg(unix)]
    Pty(Pty),
    Tcp(Tcp),
    Wire(Wire),
}

impl Line {
    /// A pseudo-terminal: hosts open its path as a serial port of any speed.
    ///
    /// # Errors
    /// If the system has none to give.
    #[cfg(unix)]
    pub fn pty() -> Result<Self, LineError> {
        Pty::open().map(|pty| Self(Kind::Pty(pty))).map_err(|errno| LineError::NoPty(errno.into()))
    }

    /// # Errors
    /// This system has no pseudo-terminals.
    #[cfg(not(unix))]
    pub fn pty() -> Result<Self, LineError> {
        Err(LineError::NoPtys)
    }

    /// A TCP port; port 0 is any that is free. It has one host at a time: another is hung up on after 0.2 s, if the
    /// first is still there then. A host that has sent nothing for 5 s gives way to another.
    ///
    /// # Errors
    /// If it cannot be listened to.
    pub fn tcp(address: &str) -> Result<Self, LineError> {
        let fails = |error| LineError::Tcp { address: address.to_owned(), error };
        Tcp::listen(address).map(|tcp| Self(Kind::Tcp(tcp))).map_err(fails)
    }

    /// A line within this process, and the host's end of it. The host counts as always there.
    #[must_use]
    pub fn within_process() -> (Self, Wire) {
        let (hub, host) = Wire::pair();
        (Self(Kind::Wire(hub)), host)
    }

    /// Bytes that have come; 0 if there are none now.
    pub fn receive(&mut self, bytes: &mut [u8]) -> usize {
        match &mut self.0 {
            #[cfg(unix)]
            Kind::Pty(pty) => pty.receive(bytes),
            Kind::Tcp(tcp) => tcp.receive(bytes),
            Kind::Wire(wire) => wire.read(bytes).unwrap_or(0),
        }
    }

    /// How many bytes were taken; 0 if the line is busy. Without a host they go nowhere.
    pub fn send(&mut self, bytes: &[u8]) -> usize {
        match &mut self.0 {
            #[cfg(unix)]
            Kind::Pty(pty) => pty.send(bytes),
            Kind::Tcp(tcp) => tcp.send(bytes),
            Kind::Wire(wire) => wire.write(bytes).unwrap_or(0),
        }
    }

    /// A host is there: connected and not silent for 5 s, or on a pseudo-terminal heard within the hub's keep-alive time
    /// of 2.5 s and, on Linux, not gone since.
    pub fn is_taken(&self) -> bool {
        match &self.0 {
            #[cfg(unix)]
            Kind::Pty(pty) => pty.is_taken(),
            Kind::Tcp(tcp) => tcp.is_taken(),
            Kind::Wire(_) => true,
        }
    }

    /// Hosts that found another one here, and were hung up on.
    pub const fn turned_away(&self) -> u32 {
        match &self.0 {
            #[cfg(unix)]
            Kind::Pty(_) => 0,
            Kind::Tcp(tcp) => tcp.turned_away(),
            Kind::Wire(_) => 0,
        }
    }
}

/// The path or address that hosts open.
impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            #[cfg(unix)]
            Kind::Pty(pty) => f.write_str(pty.path()),
            Kind::Tcp(tcp) => match tcp.address() {
                Ok(address) => write!(f, "{address}"),
                Err(error) => write!(f, "{error}"),
            },
            Kind::Wire(_) => f.write_str("within this process"),
        }
    }
}
