//! The chain line of several hubs in this process: a half-duplex line, on which every hub receives what another hub
//! sends.

use super::ready;
use embedded_io_async::{ErrorType, Read, Write};
use std::cell::RefCell;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::future::poll_fn;
use std::rc::Rc;

/// A fault of the line, or of a hub on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineFault {
    /// The hub with this index neither receives nor sends.
    Cut(usize),
    /// The hub with this index sends bytes without end, which damage all packets.
    Babbles(usize),
    /// The hub with this index sends each answer late, by this number of milliseconds.
    Late(usize, u64),
}

#[derive(Debug, Default)]
struct Shared {
    /// Bytes that each hub has not received yet, with the millisecond at which they arrive.
    incoming: Vec<VecDeque<(u64, u8)>>,
    /// What hubs have sent since the last delivery.
    sent: Vec<(usize, Vec<u8>)>,
    fault: Option<LineFault>,
    now_ms: u64,
}

/// The chain line.
#[derive(Clone, Debug)]
pub struct ChainLine(Rc<RefCell<Shared>>);

/// One hub's end of the line. It needs no waker, because all hubs are polled after each delivery.
#[derive(Clone, Debug)]
pub(super) struct ChainEnd {
    line: ChainLine,
    hub: usize,
}

impl ChainLine {
    /// A line of this number of hubs.
    pub fn new(hubs: usize) -> Self {
        Self(Rc::new(RefCell::new(Shared { incoming: vec![VecDeque::new(); hubs], ..Shared::default() })))
    }

    /// Begins a fault, or ends all faults.
    pub fn set_fault(&self, fault: Option<LineFault>) {
        self.0.borrow_mut().fault = fault;
    }

    pub(super) fn end(&self, hub: usize) -> ChainEnd {
        ChainEnd { line: self.clone(), hub }
    }

    /// Sets the time of the line in milliseconds. A hub with the fault `Babbles` sends its bytes.
    pub(super) fn begin(&self, now_ms: u64) {
        let shared = &mut *self.0.borrow_mut();
        shared.now_ms = now_ms;
        if let Some(LineFault::Babbles(hub)) = shared.fault {
            // The start of a frame that never ends.
            shared.arrive(hub, now_ms, &[0x44, 0x4B, 0x20, 0]);
        }
    }

    /// Delivers what the hubs have sent since the last call. Bytes that several hubs sent at the same time are damaged.
    /// Returns false if nothing was sent.
    pub(super) fn deliver(&self) -> bool {
        let shared = &mut *self.0.borrow_mut();
        let sent = std::mem::take(&mut shared.sent);
        let collides = sent.iter().any(|(from, _)| Some(from) != sent.first().map(|(first, _)| first));
        for (from, bytes) in &sent {
            let late_ms = match shared.fault {
                Some(LineFault::Cut(hub)) if hub == *from => continue,
                Some(LineFault::Late(hub, late_ms)) if hub == *from => late_ms,
                _ => 0,
            };
            let babbles = matches!(shared.fault, Some(LineFault::Babbles(hub)) if hub != *from);
            let damage = u8::from(collides || babbles);
            let bytes: Vec<u8> = bytes.iter().map(|byte| byte ^ damage).collect();
            shared.arrive(*from, shared.now_ms + late_ms, &bytes);
        }
        !sent.is_empty()
    }
}

impl Shared {
    /// Lets the bytes of a hub arrive at all other hubs at this time. Bytes that arrive later stay behind them.
    fn arrive(&mut self, from: usize, at_ms: u64, bytes: &[u8]) {
        for (hub, incoming) in self.incoming.iter_mut().enumerate() {
            if hub != from && self.fault != Some(LineFault::Cut(hub)) {
                let place = incoming.partition_point(|(other_ms, _)| *other_ms <= at_ms);
                let after = incoming.split_off(place);
                incoming.extend(bytes.iter().map(|byte| (at_ms, *byte)));
                incoming.extend(after);
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
        poll_fn(|_| ready(self.line.0.borrow_mut().receive(self.hub, bytes))).await
    }
}

impl Write for ChainEnd {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.line.0.borrow_mut().sent.push((self.hub, bytes.to_vec()));
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_babbling_hub_disturbs_the_others_at_once_and_not_itself() {
        let line = ChainLine::new(2);
        line.set_fault(Some(LineFault::Late(1, 50)));
        line.0.borrow_mut().sent.push((1, vec![7]));
        line.deliver();
        line.set_fault(Some(LineFault::Babbles(1)));
        line.begin(1);
        let received = [0, 1].map(|hub| line.0.borrow_mut().receive(hub, &mut [0; 8]));
        assert_eq!(received, [4, 0]);
    }
}
