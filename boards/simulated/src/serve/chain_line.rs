//! The chain line of several hubs in this process: a half-duplex line, on which every hub receives what another hub sends.

use embedded_io_async::{ErrorType, Read, Write};
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::future::poll_fn;
use std::rc::Rc;
use std::task::Poll;

/// A fault of the line, or of a hub on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineFault {
    /// The hub with this index neither receives nor sends.
    Cut(usize),
    /// The hub with this index sends bytes without end, which damage all packets.
    Babbles(usize),
    /// The hub with this index sends each answer so many milliseconds late.
    Late(usize, u64),
}

#[derive(Debug, Default)]
struct Shared {
    /// Bytes that each hub has not received yet, with the millisecond at which they arrive.
    incoming: Vec<VecDeque<(u64, u8)>>,
    fault: Option<LineFault>,
    now_ms: u64,
}

/// The chain line.
#[derive(Clone, Debug)]
pub struct ChainLine {
    shared: Rc<RefCell<Shared>>,
    /// True if bytes were sent since the last look.
    busy: Rc<Cell<bool>>,
}

/// One hub's end of the line. It needs no waker: the hubs are polled while bytes are on their way.
#[derive(Clone, Debug)]
pub(super) struct ChainEnd {
    line: ChainLine,
    hub: usize,
}

impl ChainLine {
    /// A line of this number of hubs. The hub with index 0 is the first one on the line.
    #[must_use]
    pub fn new(hubs: usize) -> Self {
        let shared = Shared { incoming: vec![VecDeque::new(); hubs], ..Shared::default() };
        Self { shared: Rc::new(RefCell::new(shared)), busy: Rc::default() }
    }

    /// Begins a fault, or ends all faults.
    pub fn set_fault(&self, fault: Option<LineFault>) {
        self.shared.borrow_mut().fault = fault;
    }

    pub(super) fn end(&self, hub: usize) -> ChainEnd {
        ChainEnd { line: self.clone(), hub }
    }

    /// Begins a millisecond.
    pub(super) fn begin(&self, now_ms: u64) {
        let shared = &mut *self.shared.borrow_mut();
        shared.now_ms = now_ms;
        if let Some(LineFault::Babbles(_)) = shared.fault {
            for incoming in &mut shared.incoming {
                // The start of a frame that never ends.
                incoming.extend([0x44, 0x4B, 0x20, 0].map(|byte| (now_ms, byte)));
            }
        }
    }

    /// True if bytes were sent since the last call.
    pub(super) fn take_busy(&self) -> bool {
        self.busy.take()
    }
}

impl Shared {
    fn send(&mut self, from: usize, bytes: &[u8]) {
        let late_ms = match self.fault {
            Some(LineFault::Cut(hub)) if hub == from => return,
            Some(LineFault::Late(hub, late_ms)) if hub == from => late_ms,
            _ => 0,
        };
        let damage = u8::from(matches!(self.fault, Some(LineFault::Babbles(hub)) if hub != from));
        for (hub, incoming) in self.incoming.iter_mut().enumerate() {
            if hub != from && self.fault != Some(LineFault::Cut(hub)) {
                incoming.extend(bytes.iter().map(|byte| (self.now_ms + late_ms, byte ^ damage)));
            }
        }
    }

    fn receive(&mut self, hub: usize, bytes: &mut [u8]) -> usize {
        let now_ms = self.now_ms;
        let Some(incoming) = self.incoming.get_mut(hub) else { return 0 };
        let mut received = 0;
        for byte in bytes {
            let Some((_, next)) = incoming.pop_front_if(|(at_ms, _)| *at_ms <= now_ms) else { break };
            *byte = next;
            received += 1;
        }
        received
    }
}

impl ErrorType for ChainEnd {
    type Error = Infallible;
}

impl Read for ChainEnd {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        poll_fn(|_| match self.line.shared.borrow_mut().receive(self.hub, bytes) {
            0 => Poll::Pending,
            received => Poll::Ready(Ok(received)),
        })
        .await
    }
}

impl Write for ChainEnd {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.line.shared.borrow_mut().send(self.hub, bytes);
        self.line.busy.set(true);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
