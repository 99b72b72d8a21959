//! The far end of a serial line: sends bytes to the chip at chosen times, and notes the chip's bytes with their times.

use std::collections::VecDeque;

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

/// A terminal that stores all bytes.
#[derive(Debug, Default)]
pub(crate) struct Terminal {
    /// Bytes to send, each with its earliest time in ns. The line takes them no faster than its baud rate.
    pub(crate) outgoing: VecDeque<(u64, u8)>,
    /// Received bytes, each with the time in ns at which its stop bit ended.
    pub(crate) incoming: Vec<(u64, u8)>,
}

impl Store for Terminal {}

impl Peer for Terminal {
    fn receive(&mut self, word: u16, context: &mut Timeline<'_, '_>) {
        self.incoming.push((context.now().0, word.to_le_bytes()[0]));
    }

    fn transmit(&mut self, now: VirtualNanos) -> Option<u16> {
        let &(at, byte) = self.outgoing.front()?;
        (at <= now.0).then(|| {
            self.outgoing.pop_front();
            u16::from(byte)
        })
    }
}
