//! A line to hosts that come and go: to the hub it is a serial line that never ends.

use std::fmt;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};

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
    #[error("{address} cannot be listened to: {error}; give HOST:PORT, such as 127.0.0.1:7070")]
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
    /// One host at a time; others wait until it hangs up.
    Tcp(TcpListener, Option<TcpStream>),
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

    /// A TCP port; port 0 is any that is free.
    ///
    /// # Errors
    /// If it cannot be listened to.
    pub fn tcp(address: &str) -> Result<Self, LineError> {
        let fails = |error| LineError::Tcp { address: address.to_owned(), error };
        let listener = TcpListener::bind(address).map_err(fails)?;
        listener.set_nonblocking(true).map_err(fails)?;
        Ok(Self(Kind::Tcp(listener, None)))
    }

    /// Bytes that have come; 0 if there are none now.
    pub fn receive(&mut self, bytes: &mut [u8]) -> usize {
        match &mut self.0 {
            #[cfg(unix)]
            Kind::Pty(pty) => pty.receive(bytes),
            Kind::Tcp(listener, host) => {
                if host.is_none() {
                    *host = accept(listener);
                }
                done(host, |stream| stream.read(bytes))
            }
        }
    }

    /// How many bytes were taken; 0 if the line is busy. Without a host they go nowhere.
    pub fn send(&mut self, bytes: &[u8]) -> usize {
        match &mut self.0 {
            #[cfg(unix)]
            Kind::Pty(pty) => pty.send(bytes),
            Kind::Tcp(_, host @ Some(_)) => done(host, |stream| stream.write(bytes)),
            Kind::Tcp(_, None) => bytes.len(),
        }
    }
}

/// The path or address that hosts open.
impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            #[cfg(unix)]
            Kind::Pty(pty) => f.write_str(pty.path()),
            Kind::Tcp(listener, _) => match listener.local_addr() {
                Ok(address) => write!(f, "{address}"),
                Err(error) => write!(f, "{error}"),
            },
        }
    }
}

fn accept(listener: &TcpListener) -> Option<TcpStream> {
    // Nobody there, or gone already.
    let (stream, _) = listener.accept().ok()?;
    // A reply is one burst, and it is wanted now.
    (stream.set_nonblocking(true).is_ok() && stream.set_nodelay(true).is_ok()).then_some(stream)
}

/// Bytes moved; a host that has hung up, or whose connection is broken, is forgotten.
fn done(
    host: &mut Option<TcpStream>,
    action: impl FnOnce(&mut TcpStream) -> std::io::Result<usize>,
) -> usize {
    let Some(stream) = host else { return 0 };
    match action(stream) {
        Ok(moved) if moved > 0 => moved,
        Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted) => 0,
        Ok(_) | Err(_) => {
            *host = None;
            0
        }
    }
}
