//! A chain of simulated hubs, in virtual time: answers and reports that a host at the parent gets from the children.

use motor_hub::chain::ChainReport;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::protocol::motor::ToMotor;
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::requests::{DISCOVERY, FAIL_SAFE, Standard};
use motor_hub::protocol::{Address, BROADCAST, Decoder, Packet, Reply, frame};
use motor_hub::units::{Control, Micros};
use simulated::scenario::Scenario;
use simulated::serve::{self, Hubs, Line, LineFault, Wire};
use std::future::Future;
use std::io::{Read, Write};
use std::pin::Pin;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::task::{Context, Waker};

/// All tests of the process share the clock of the mock driver, so they run one after another.
static CLOCK: Mutex<()> = Mutex::new(());

/// Time after which a motor can be enabled.
const AWAKE_MS: u32 = 200;

struct Chain {
    hubs: Pin<Box<dyn Future<Output = ()>>>,
    line: serve::ChainLine,
    host: Wire,
    decoder: Decoder,
    number: u8,
    ms: u64,
    _clock: MutexGuard<'static, ()>,
}

impl Chain {
    fn new(addresses: &[u8]) -> Self {
        let clock = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
        let addresses = addresses.iter().map(|&address| Address::new(address).expect("1 to 254")).collect();
        let hubs = Hubs::chain(addresses);
        let (line, (end, host)) = (hubs.line.clone(), Line::within_process());
        let served = async move {
            serve::steps(&Scenario::to_serve(), &hubs, end, None, &mut |_| (), &mut |_| true)
                .await
                .expect("it runs");
        };
        let mut chain = Self {
            hubs: Box::pin(served),
            line,
            host,
            decoder: Decoder::new(),
            number: 0,
            ms: 0,
            _clock: clock,
        };
        chain.pass(AWAKE_MS);
        chain
    }

    /// Lets a millisecond pass, and returns the packets that the host gets.
    fn step(&mut self) -> Vec<Packet> {
        self.ms += 1;
        assert!(self.hubs.as_mut().poll(&mut Context::from_waker(Waker::noop())).is_pending());
        let mut bytes = [0; 1024];
        let length = self.host.read(&mut bytes).unwrap_or(0);
        let mut input = &bytes[..length];
        let now = Micros::new(1_000 * self.ms);
        std::iter::from_fn(|| self.decoder.next(&mut input, now)).collect()
    }

    fn pass(&mut self, ms: u32) -> Vec<Packet> {
        (0..ms).flat_map(|_| self.step()).collect()
    }

    /// Sends a request, and returns its number.
    fn send(&mut self, request: impl Into<Request>, address: u8) -> u8 {
        self.number = self.number.checked_add(1).unwrap_or(1);
        let request = request.into();
        let packet = request.packet(address, self.number, request.id());
        self.host.write_all(&frame::encode(&packet)).expect("a queue");
        self.number
    }

    /// Sends a request, and returns the answer with the time that it took; `None` after 100 ms.
    fn ask(&mut self, request: impl Into<Request>, address: u8) -> Option<(Packet, u64)> {
        let (number, begun) = (self.send(request, address), self.ms);
        (0..100).find_map(|_| {
            let packets = self.step();
            let answer =
                packets.into_iter().find(|packet| packet.source == address && packet.reference == number);
            answer.map(|packet| (packet, self.ms - begun))
        })
    }

    fn obeys(&mut self, request: impl Into<Request>, address: u8) -> bool {
        let answer = self.ask(request, address);
        matches!(
            answer.and_then(|(packet, _)| Reply::read(&packet, packet.id & 0x7FFF)),
            Some(Reply::Ack { .. })
        )
    }

    fn is_enabled(&mut self, address: u8) -> bool {
        let (answer, _) = self.ask(ToMotor::Enable.to(0), address).expect("an answer");
        answer.payload.first() == Some(&1)
    }

    /// Lets motor 0 of the hub run with full power.
    fn drive(&mut self, address: u8) {
        assert!(self.obeys(ToMotor::SetPower { power: Control::MAX }.to(0), address));
        assert!(self.obeys(ToMotor::SetEnable { on: true }.to(0), address));
    }

    fn report(&mut self) -> ChainReport {
        let (answer, _) = self.ask(HubFunction::Chain, PARENT).expect("an answer");
        ChainReport::read(&mut Fields::new(&answer.payload)).expect("a report")
    }
}

const PARENT: u8 = 2;

#[test]
fn a_discovery_finds_the_parent_at_once_and_every_child_within_a_second() {
    let mut chain = Chain::new(&[PARENT, 1, 254, 130]);
    chain.send(Standard::Discovery, BROADCAST);
    let mut children: Vec<Packet> = chain.pass(600);
    let parent = children.remove(0);
    assert_eq!((parent.source, &*parent.payload), (PARENT, &[1][..]));
    let number = chain.number;
    assert!(children.iter().all(|packet| packet.reference == number && packet.id == DISCOVERY | 0x8000));
    assert_eq!(
        children.iter().map(|packet| (packet.source, packet.payload[0])).collect::<Vec<_>>(),
        [(1, 0), (130, 0), (254, 0)]
    );
    let report = chain.report();
    assert!(!report.discovering);
    assert_eq!(report.answering.iter().collect::<Vec<_>>(), [1, 130, 254]);
    assert_eq!(report.duplicate.iter().count(), 0);
}

#[test]
fn a_child_obeys_like_a_hub_on_the_line_and_stops_by_its_own_keep_alive() {
    let mut chain = Chain::new(&[PARENT, 3]);
    chain.drive(3);
    assert!(chain.is_enabled(3) && !chain.is_enabled(PARENT));
    // Packets to the parent do not keep the child alive.
    for _ in 0..26 {
        assert!(chain.obeys(Standard::KeepAlive, PARENT));
        chain.pass(99);
    }
    assert!(!chain.is_enabled(3));
    let (status, _) = chain.ask(Standard::Status { clear: false }, 3).expect("an answer");
    assert_eq!(status.payload[0] & 1, 1, "the keep-alive timer of the child has run out");
}

#[test]
fn the_parent_answers_within_two_milliseconds_whatever_its_child_does() {
    for fault in [
        None,
        Some(LineFault::Cut(1)),
        Some(LineFault::Babbles(1)),
        Some(LineFault::Late(1, 9)),
        Some(LineFault::Late(1, 60)),
    ] {
        let mut chain = Chain::new(&[PARENT, 3, 4]);
        chain.line.set_fault(fault);
        chain.send(Standard::Discovery, BROADCAST);
        chain.pass(3);
        let mut answers_of_other_child = 0;
        for _ in 0..100 {
            // The host sends to the child without waiting for its answer, and sends again in the next round.
            chain.send(Standard::Status { clear: false }, 3);
            let (_, ms) = chain.ask(Standard::KeepAlive, PARENT).expect("an answer");
            assert!(ms <= 2, "{fault:?}: {ms} ms");
            answers_of_other_child +=
                u32::from(chain.ask(Standard::KeepAlive, 4).is_some_and(|(_, ms)| ms <= 30));
            chain.pass(10);
        }
        if fault != Some(LineFault::Babbles(1)) {
            assert!(answers_of_other_child >= 99, "{fault:?}: {answers_of_other_child} of 100");
        }
        // The child answers again immediately after the end of the fault.
        chain.line.set_fault(None);
        chain.pass(100);
        assert!(chain.ask(Standard::KeepAlive, 3).is_some(), "{fault:?}");
    }
}

#[test]
fn a_stop_to_all_reaches_every_hub_within_fifty_milliseconds_also_beside_a_lost_child() {
    let mut chain = Chain::new(&[PARENT, 3, 4]);
    for address in [PARENT, 3, 4] {
        chain.drive(address);
    }
    chain.line.set_fault(Some(LineFault::Cut(1)));
    for _ in 0..8 {
        chain.send(Standard::KeepAlive, 3);
    }
    let stop = Request::from(Standard::FailSafe).packet(BROADCAST, 99, FAIL_SAFE);
    chain.host.write_all(&frame::encode(&stop)).expect("a queue");
    let answers = chain.pass(50);
    assert_eq!(answers.iter().map(|packet| packet.source).collect::<Vec<_>>(), [PARENT], "no child answers");
    assert!(!chain.is_enabled(PARENT));
    chain.pass(100);
    let (status, _) = chain.ask(Standard::Status { clear: false }, 4).expect("an answer");
    assert_eq!(status.payload[0] & 4, 4, "fail-safe");
    assert!(!chain.is_enabled(4));
}

#[test]
fn a_discovery_reports_hubs_with_the_same_address() {
    for (addresses, clashing) in [(&[PARENT, 7, 7][..], 7), (&[PARENT, PARENT, 5], PARENT)] {
        let mut chain = Chain::new(addresses);
        chain.send(Standard::Discovery, BROADCAST);
        let found: Vec<u8> = chain.pass(600).iter().map(|packet| packet.source).collect();
        assert_eq!(chain.report().duplicate.iter().collect::<Vec<_>>(), [clashing], "{addresses:?}");
        assert!(!found.contains(&7), "{found:?}");
    }
    // The parent gets another address, and the child can be used.
    let mut chain = Chain::new(&[PARENT, PARENT]);
    assert!(chain.obeys(Standard::SetAddress { address: Address::new(9).expect("9") }, PARENT));
    assert!(chain.obeys(Standard::KeepAlive, PARENT) && chain.obeys(Standard::KeepAlive, 9));
}
