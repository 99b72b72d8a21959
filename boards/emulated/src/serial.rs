//! The far end of the serial line: bytes in at chosen instants, bytes out with theirs.

use std::collections::VecDeque;

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::snapshot::Store;
use rigless::time::VirtualNanos;

/// A terminal with a memory.
#[derive(Debug, Default)]
pub(crate) struct Terminal {
    /// Bytes to send, each from its instant on, in ns; the line's speed spaces them out.
    pub(crate) outgoing: VecDeque<(u64, u8)>,
    /// Words received, with the instant at which their stop bit ended, in ns.
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
