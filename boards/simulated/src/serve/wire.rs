//! A line within this process.

use super::line::Line;
use std::collections::VecDeque;
use std::fmt::{self, Display, Formatter};
use std::io::{ErrorKind, Read, Result, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Bytes that were sent in one direction and not received yet.
#[derive(Clone, Debug, Default)]
struct Queue(Arc<Mutex<VecDeque<u8>>>);

impl Queue {
    fn bytes(&self) -> MutexGuard<'_, VecDeque<u8>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One end of a line within this process. A read without bytes fails as `WouldBlock`.
#[derive(Debug)]
pub struct Wire {
    incoming: Queue,
    outgoing: Queue,
}

impl Wire {
    /// Creates both ends of a line.
    #[must_use]
    pub fn pair() -> (Self, Self) {
        let (one, other) = (Queue::default(), Queue::default());
        (Self { incoming: one.clone(), outgoing: other.clone() }, Self { incoming: other, outgoing: one })
    }
}

impl Read for Wire {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
        let mut incoming = self.incoming.bytes();
        if incoming.is_empty() { Err(ErrorKind::WouldBlock.into()) } else { incoming.read(bytes) }
    }
}

impl Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.outgoing.bytes().extend(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
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
