//! The line between a served hub and its hosts. Hosts connect and disconnect. For the hub the line is a serial line
//! that is always open.

use super::tcp::Tcp;
use std::fmt::{self, Debug, Display, Formatter};
use std::io::{self, ErrorKind, Read, Write};
use std::sync::mpsc::{Receiver, Sender, channel};

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

/// A line whose calls never block. `Display` writes the path or address that hosts open.
pub trait Line: Debug + Display + Send {
    /// Reads bytes that have arrived. Returns their number, 0 if there are none.
    fn receive(&mut self, bytes: &mut [u8]) -> usize;

    /// Sends bytes. Returns the number of accepted bytes, 0 if the line is busy. Without a host all bytes are dropped.
    fn send(&mut self, bytes: &[u8]) -> usize;

    /// Returns true if a host is on the line. On TCP the host is connected and has sent something within 5 s. On a
    /// pseudo-terminal a host has sent something within the hub's keep-alive time of 2.5 s. On Linux the host also must
    /// not have closed the pseudo-terminal since. A line within this process always has a host.
    fn is_taken(&self) -> bool;

    /// Returns the number of hosts that were disconnected because another host was connected.
    fn rejected_hosts(&self) -> u32 {
        0
    }
}

/// Opens a pseudo-terminal: hosts open its path as a serial port of any speed.
///
/// # Errors
/// If the system refuses a pseudo-terminal.
#[cfg(unix)]
pub fn pty() -> Result<Box<dyn Line>, LineError> {
    Ok(Box::new(Pty::open().map_err(|errno| LineError::NoPty(errno.into()))?))
}

/// # Errors
/// This system has no pseudo-terminals.
#[cfg(not(unix))]
pub fn pty() -> Result<Box<dyn Line>, LineError> {
    Err(LineError::NoPtys)
}

/// Opens a TCP port; port 0 stands for any free port. The port serves one host at a time. A second host is disconnected
/// after 0.2 s if the first is still connected. A host that has sent nothing for 5 s is disconnected when another host
/// connects.
///
/// # Errors
/// If the program cannot listen on the address.
pub fn tcp(address: &str) -> Result<Box<dyn Line>, LineError> {
    let fails = |error| LineError::Tcp { address: address.to_owned(), error };
    Ok(Box::new(Tcp::listen(address).map_err(fails)?))
}

/// Creates a line within this process, and the host's end of it. The host counts as connected all the time.
pub fn within_process() -> (Box<dyn Line>, Wire) {
    let ((to_hub, from_host), (to_host, from_hub)) = (channel(), channel());
    let hub = Wire { incoming: from_host, outgoing: to_host };
    (Box::new(hub), Wire { incoming: from_hub, outgoing: to_hub })
}

/// One end of a line within this process. A read without bytes fails as `WouldBlock`.
#[derive(Debug)]
pub struct Wire {
    incoming: Receiver<u8>,
    outgoing: Sender<u8>,
}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let received =
            bytes.iter_mut().zip(self.incoming.try_iter()).map(|(byte, next)| *byte = next).count();
        if received == 0 { Err(ErrorKind::WouldBlock.into()) } else { Ok(received) }
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        // Bytes to an end that is gone are dropped.
        bytes.iter().for_each(|byte| self.outgoing.send(*byte).unwrap_or_default());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Line for Wire {
    fn receive(&mut self, bytes: &mut [u8]) -> usize {
        self.read(bytes).unwrap_or(0)
    }

    fn send(&mut self, bytes: &[u8]) -> usize {
        self.write(bytes).unwrap_or(0)
    }

    fn is_taken(&self) -> bool {
        true
    }
}

impl Display for Wire {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str("within this process")
    }
}
