//! The far end of a serial line: sends bytes to the chip, and notes the chip's bytes with their times.

use std::collections::VecDeque;
use std::time::Duration;

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

/// One byte on the serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialByte {
    /// Time at which the stop bit of the byte ended.
    pub at: Duration,
    /// The byte.
    pub byte: u8,
}

/// A terminal that stores all bytes.
#[derive(Debug, Default)]
pub(crate) struct Terminal {
    /// Bytes to send. The line takes them no faster than its baud rate.
    pub(crate) outgoing: VecDeque<u8>,
    pub(crate) incoming: Vec<SerialByte>,
}

impl Store for Terminal {}

impl Peer for Terminal {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        let at = Duration::from_nanos(context.now().0);
        self.incoming.push(SerialByte { at, byte: word.to_le_bytes()[0] });
    }

    fn transmit(&mut self, _: VirtualNanos) -> Option<u16> {
        self.outgoing.pop_front().map(u16::from)
    }
}
