//! A chain of hubs: emulated chips, each with its own motors, on one half-duplex line.

use std::sync::mpsc::Receiver;
use std::time::Duration;

use super::{Bench, Setup, nanos};
use crate::host_link::{BYTE, Line};
use crate::surroundings::terminal;
use crate::wiring;

/// Time for which the chips run before bytes are exchanged, ns. A byte arrives at most this time later than on a real
/// line. The first byte after an idle time arrives at most [`IDLE_STEP`] later.
const STEP: u64 = 100_000;

/// Time for which the chips run before bytes are exchanged while the line is idle, ns.
const IDLE_STEP: u64 = 1_000_000;

/// Time without a byte after which the line counts as idle, ns. It is longer than the 10 ms that a parent waits for an
/// answer.
const IDLE_AFTER: u64 = 11_000_000;

/// Number of bytes waiting at the input of a hub from which on further bytes for the hub are dropped: about the bytes of
/// two steps.
const WAITING: usize = 8;

/// Mean time between two bytes of noise, in steps of [`STEP`].
const NOISE_PERIOD: u64 = 7;

/// A fault of the line, or of a hub on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LineFault {
    /// The line is cut at each hub, so that no byte arrives.
    Cut,
    /// A wire of the line is shorted, so that all receivers read low.
    Shorted,
    /// One of sixteen bytes is damaged at random, and further bytes arrive that no hub has sent.
    Noise,
    /// A transceiver sends the beginnings of packets without end, and never completes a packet.
    Babble,
}

/// Hubs on one line. The first hub has the host.
pub struct ChainBench {
    /// The hubs.
    pub hubs: Vec<Bench>,
    fault: Option<LineFault>,
    /// Number of bytes of each hub that have passed the line.
    passed: Vec<usize>,
    /// The sequence is the same in each run.
    random: fastrand::Rng,
    /// Time in ns until which bytes are exchanged after each [`STEP`].
    busy_until: u64,
}

impl ChainBench {
    /// Powers on hubs on these boards, with their motors. A hub alone has a transceiver only if its setup has one.
    pub fn new(setups: Vec<Setup>) -> Self {
        let chained = setups.len() > 1;
        let mut hubs: Vec<Bench> = setups
            .into_iter()
            .map(|setup| Bench::new(Setup { transceiver: chained || setup.transceiver, ..setup }))
            .collect();
        hubs.iter_mut().skip(1).for_each(|child| child.use_line(wiring::CHAIN));
        let passed = vec![0; hubs.len()];
        Self { hubs, fault: None, passed, random: fastrand::Rng::with_seed(1), busy_until: 0 }
    }

    /// Begins a fault of the line, or ends it.
    pub fn set_fault(&mut self, fault: Option<LineFault>) {
        self.fault = fault;
        if fault == Some(LineFault::Shorted) {
            // A receiver takes the falling edge for a start bit, receives a zero, and waits for the next falling edge.
            (0..self.hubs.len()).for_each(|hub| self.deliver(hub, &[0]));
        }
    }

    /// Returns the virtual time since power-on.
    pub fn now(&self) -> Duration {
        self.hubs.first().map_or(Duration::ZERO, Bench::now)
    }

    /// Runs all hubs for some virtual time.
    pub fn run(&mut self, time: Duration) {
        if let [alone] = &mut self.hubs[..] {
            alone.run(time);
            return;
        }
        let end = nanos(self.now() + time);
        let line = self.hubs[0].line;
        if self.hubs[0].at_stop(move |_, session, _| !terminal(session, line).outgoing.is_empty()) {
            self.busy_until = nanos(self.now()) + IDLE_AFTER;
        }
        while let now = nanos(self.now())
            && now < end
        {
            let step = if now < self.busy_until { STEP } else { IDLE_STEP };
            let target = end.min(now + step);
            // All hubs run at the same time.
            let sent: Vec<_> = (0..self.hubs.len()).map(|hub| self.run_hub(hub, target)).collect();
            self.pass_bytes(&sent);
        }
    }

    /// Makes a hub run until this time, ns, and returns meanwhile. The bytes that the hub sends on the line will be in the channel.
    fn run_hub(&mut self, hub: usize, target: u64) -> Receiver<Vec<u8>> {
        let passed = self.passed[hub];
        let hub = &mut self.hubs[hub];
        hub.run_until(Duration::from_nanos(target));
        hub.post(move |_, session, _| {
            let incoming = &terminal(session, wiring::CHAIN).incoming;
            incoming.iter().skip(passed).map(|sent| sent.byte).collect()
        })
    }

    /// Passes on what the hubs have sent on the line.
    fn pass_bytes(&mut self, sent: &[Receiver<Vec<u8>>]) {
        let sent: Vec<Vec<u8>> = self.hubs.iter_mut().zip(sent).map(|(hub, sent)| hub.wait(sent)).collect();
        let mut on_chain = self.fault.is_some();
        for (from, sent) in sent.into_iter().enumerate() {
            self.passed[from] += sent.len();
            if sent.is_empty() {
                continue;
            }
            on_chain = true;
            let arrived: Vec<u8> = match self.fault {
                None => sent,
                Some(LineFault::Cut | LineFault::Shorted) => continue,
                Some(LineFault::Noise) => sent
                    .into_iter()
                    .map(|byte| if self.random.u8(..16) == 0 { byte ^ 0x10 } else { byte })
                    .collect(),
                Some(LineFault::Babble) => sent.into_iter().map(|byte| byte ^ 0x55).collect(),
            };
            (0..self.hubs.len()).filter(|&to| to != from).for_each(|to| self.deliver(to, &arrived));
        }
        if on_chain {
            self.busy_until = nanos(self.now()) + IDLE_AFTER;
        }
        let disturbance = match self.fault {
            Some(LineFault::Noise) if self.random.u64(..NOISE_PERIOD) == 0 => vec![self.random.u8(..)],
            Some(LineFault::Babble) => vec![0x44, 0x4B, 0x20, 0, 0],
            _ => return,
        };
        (0..self.hubs.len()).for_each(|to| self.deliver(to, &disturbance));
    }

    /// Puts bytes on the input of a hub. Drops the bytes if [`WAITING`] or more bytes still wait there.
    fn deliver(&mut self, hub: usize, bytes: &[u8]) {
        let bytes = bytes.to_vec();
        self.hubs[hub].post(move |_, session, _| {
            let outgoing = &mut terminal(session, wiring::CHAIN).outgoing;
            if outgoing.len() < WAITING {
                outgoing.extend(bytes);
            }
        });
    }

    /// Returns the beginnings and ends of the times in which a hub had its transceiver switched to sending. Only the
    /// emulated STM32F427, which stands for the F429, records these times.
    pub fn sending(&mut self, hub: usize) -> Vec<(Duration, Duration)> {
        let directions = self.hubs[hub].at_stop(|surroundings, _, _| surroundings.directions.clone());
        let (pairs, _) = directions.as_chunks::<2>();
        pairs.iter().map(|[from, to]| (Duration::from_nanos(from.0), Duration::from_nanos(to.0))).collect()
    }

    /// Returns the times at which the bytes that a hub has sent on the line begin and end.
    pub fn sent(&mut self, hub: usize) -> Vec<(Duration, Duration)> {
        let sent = self.hubs[hub].at_stop(|_, session, _| terminal(session, wiring::CHAIN).incoming.clone());
        sent.into_iter().map(|sent| (sent.at - BYTE, sent.at)).collect()
    }
}

impl Line for ChainBench {
    fn first(&mut self) -> &mut Bench {
        &mut self.hubs[0]
    }

    fn run(&mut self, time: Duration) {
        Self::run(self, time);
    }
}
