//! The line between a served hub and its hosts. Hosts connect and disconnect. For the hub the line is a serial line
//! that is always open.

use super::tcp::Tcp;
use super::wire::Wire;
use std::fmt::{self, Debug};

#[cfg(unix)]
use super::pty::Pty;

/// Error of opening a line.
#[derive(Debug, thiserror::Error)]
pub enum LineError {
    /// The system refuses a pseudo-terminal.
    #[error("the system refuses a pseudo-terminal: {0}")]
    NoPty(std::io::Error),
    /// Only Unix has pseudo-terminals.
    #[error("this system has no pseudo-terminals")]
    NoPtys,
    /// The program cannot listen on the address.
    #[error("cannot listen on {address}: {error}")]
    Tcp {
        /// The given address.
        address: String,
        /// Error of the operating system.
        error: std::io::Error,
    },
}

/// One kind of line. The methods of [`Line`] call the methods of the same name.
pub(super) trait HostLine: Debug + Send {
    fn receive(&mut self, bytes: &mut [u8]) -> usize;
    fn send(&mut self, bytes: &[u8]) -> usize;
    fn is_taken(&self) -> bool;
    fn rejected_hosts(&self) -> u32 {
        0
    }
    /// The path or address that hosts open.
    fn address(&self) -> String;
}

/// A line whose calls never block. `Display` writes the path or address that hosts open.
#[derive(Debug)]
pub struct Line(Box<dyn HostLine>);

impl Line {
    /// A pseudo-terminal: hosts open its path as a serial port of any speed.
    ///
    /// # Errors
    /// If the system refuses a pseudo-terminal.
    #[cfg(unix)]
    pub fn pty() -> Result<Self, LineError> {
        Pty::open().map(|pty| Self(Box::new(pty))).map_err(|errno| LineError::NoPty(errno.into()))
    }

    /// # Errors
    /// This system has no pseudo-terminals.
    #[cfg(not(unix))]
    pub fn pty() -> Result<Self, LineError> {
        Err(LineError::NoPtys)
    }

    /// A TCP port; port 0 stands for any free port. The port serves one host at a time. A second host is disconnected
    /// after 0.2 s if the first is still connected. A host that has sent nothing for 5 s is disconnected when another
    /// host connects.
    ///
    /// # Errors
    /// If the program cannot listen on the address.
    pub fn tcp(address: &str) -> Result<Self, LineError> {
        let fails = |error| LineError::Tcp { address: address.to_owned(), error };
        Tcp::listen(address).map(|tcp| Self(Box::new(tcp))).map_err(fails)
    }

    /// A line within this process, and the host's end of it. The host counts as connected all the time.
    #[must_use]
    pub fn within_process() -> (Self, Wire) {
        let (hub, host) = Wire::pair();
        (Self(Box::new(hub)), host)
    }

    /// Reads bytes that have arrived. Returns their number, 0 if there are none.
    pub fn receive(&mut self, bytes: &mut [u8]) -> usize {
        self.0.receive(bytes)
    }

    /// Sends bytes. Returns the number of accepted bytes, 0 if the line is busy. Without a host all bytes are dropped.
    pub fn send(&mut self, bytes: &[u8]) -> usize {
        self.0.send(bytes)
    }

    /// Returns true if a host is on the line. On TCP the host is connected and has sent something within 5 s. On a
    /// pseudo-terminal a host has sent something within the hub's keep-alive time of 2.5 s. On Linux the host also must
    /// not have closed the pseudo-terminal since. A line within this process always has a host.
    pub fn is_taken(&self) -> bool {
        self.0.is_taken()
    }

    /// Returns the number of hosts that were disconnected because another host was connected.
    pub fn rejected_hosts(&self) -> u32 {
        self.0.rejected_hosts()
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.address())
    }
}
