//! A host of served hubs, in virtual time.

use motor_hub::chain::ChainReport;
use motor_hub::extension::{HubFunction, Request};
use motor_hub::protocol::motor::ToMotor;
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::{Address, Decoder, Packet, Reply, frame};
use motor_hub::units::{Control, Micros};
use simulated::scenario::Scenario;
use simulated::serve::interventions::Interventions;
use simulated::serve::{self, ChainLine, Hubs, Wire};
use std::future::Future;
use std::io::{Read, Write};
use std::pin::Pin;
use std::sync::{MutexGuard, PoisonError};
use std::task::{Context, Waker};

pub(crate) struct Served {
    hubs: Pin<Box<dyn Future<Output = ()>>>,
    pub(crate) line: ChainLine,
    pub(crate) host: Wire,
    decoder: Decoder,
    pub(crate) number: u8,
    ms: u64,
    _clock: MutexGuard<'static, ()>,
}

impl Served {
    /// Serves hubs with these addresses, with the interventions of each millisecond.
    pub(crate) fn new(
        scenario: Scenario,
        addresses: &[u8],
        interventions: impl Fn(u32) -> Interventions + 'static,
    ) -> Self {
        let clock = crate::CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
        let addresses = addresses.iter().map(|&address| Address::new(address).expect("1 to 254")).collect();
        let hubs = Hubs::chain(addresses);
        let (line, (end, host)) = (hubs.line.clone(), serve::within_process());
        let mut ms = 0;
        let mut intervene = move |now: &mut _| {
            *now = interventions(ms);
            ms += 1;
        };
        let served = async move {
            serve::steps(&scenario, &hubs, end, None, &mut intervene, &mut |_| true).await.expect("it runs");
        };
        Self { hubs: Box::pin(served), line, host, decoder: Decoder::new(), number: 0, ms: 0, _clock: clock }
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

    pub(crate) fn pass(&mut self, ms: u32) -> Vec<Packet> {
        (0..ms).flat_map(|_| self.step()).collect()
    }

    pub(crate) fn send(&mut self, request: impl Into<Request>, address: u8) -> u8 {
        self.number = self.number.checked_add(1).unwrap_or(1);
        let request = request.into();
        let packet = request.packet(address, self.number, request.id());
        self.host.write_all(&frame::encode(&packet)).expect("a queue");
        self.number
    }

    /// Sends a request, and returns the answer with the time that it took; `None` after 100 ms.
    pub(crate) fn ask(&mut self, request: impl Into<Request>, address: u8) -> Option<(Packet, u64)> {
        let (number, begun) = (self.send(request, address), self.ms);
        (0..100).find_map(|_| {
            let packets = self.step();
            let answer =
                packets.into_iter().find(|packet| packet.source == address && packet.reference == number);
            answer.map(|packet| (packet, self.ms - begun))
        })
    }

    pub(crate) fn obeys(&mut self, request: impl Into<Request>, address: u8) -> bool {
        let answer = self.ask(request, address);
        matches!(
            answer.and_then(|(packet, _)| Reply::read(&packet, packet.id & 0x7FFF)),
            Some(Reply::Ack { .. })
        )
    }

    pub(crate) fn value<A: Field>(&mut self, request: impl Into<Request>, address: u8) -> A {
        let (answer, _) = self.ask(request, address).expect("an answer");
        A::read(&mut Fields::new(&answer.payload)).expect("a value")
    }

    pub(crate) fn is_enabled(&mut self, address: u8) -> bool {
        let (answer, _) = self.ask(ToMotor::Enable.to(0), address).expect("an answer");
        answer.payload.first() == Some(&1)
    }

    /// Lets motor 0 of the hub run with full power.
    pub(crate) fn drive(&mut self, address: u8) {
        assert!(self.obeys(ToMotor::SetPower { power: Control::MAX }.to(0), address));
        assert!(self.obeys(ToMotor::SetEnable { on: true }.to(0), address));
    }

    pub(crate) fn report(&mut self, address: u8) -> ChainReport {
        self.value(HubFunction::Chain, address)
    }
}
