//! A host at the serial line: sends requests to the firmware, and notes the time at which each packet of the hub arrives.
//!
//! ```no_run
//! use emulated::{Bench, Setup, host_link::HostLink};
//! use std::time::Duration;
//!
//! let mut bench = Bench::new(Setup::new(vec![]));
//! bench.run(Duration::from_millis(300));
//! let mut host = HostLink::default();
//! host.velocity(&mut bench, 0, 500);
//! println!("{:?}", host.bulk(&mut bench).velocities);
//! ```

use std::time::Duration;

use motor_hub::extension::Request;
use motor_hub::protocol::answers::{Bulk, Reply};
use motor_hub::protocol::frame::{self, Decoder, OVERHEAD, Packet};
use motor_hub::protocol::motor::{ChannelMode, RunMode, Target, ToMotor};
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::requests::{Standard, ToHub};
use motor_hub::protocol::{Address, HOST};
use motor_hub::units::{Control, Micros};

use crate::bench::Bench;

/// A packet that arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// Time at which the last stop bit ended.
    pub at: Duration,
    /// The packet.
    pub packet: Packet,
}

/// The host's end of the line.
#[derive(Debug)]
pub struct HostLink {
    address: Address,
    message: u8,
    decoder: Decoder,
    /// Number of bytes received since the last packet.
    bytes: usize,
}

impl Default for HostLink {
    fn default() -> Self {
        Self::new(Address::DEFAULT)
    }
}

impl HostLink {
    /// Creates the link to the hub with this address.
    #[must_use]
    pub const fn new(address: Address) -> Self {
        Self { address, message: 0, decoder: Decoder::new(), bytes: 0 }
    }

    /// Returns the bytes of the next packet. The payload may have any content.
    ///
    /// # Panics
    /// Panics if the payload is too long for a packet.
    pub fn packet(&mut self, id: u16, payload: &[u8]) -> Vec<u8> {
        self.message = self.message.checked_add(1).unwrap_or(1);
        let payload = payload.try_into().expect("a short payload");
        let (destination, number) = (self.address.get(), self.message);
        frame::encode(&Packet { destination, source: HOST, number, reference: 0, id, payload }).to_vec()
    }

    /// Returns the packets that have arrived since the last call.
    ///
    /// # Panics
    /// Panics if the hub has sent bytes that are no packet.
    pub fn arrivals(&mut self, bench: &mut Bench) -> Vec<Arrival> {
        let mut arrivals = Vec::new();
        for received in bench.receive() {
            self.bytes += 1;
            let now = Micros::new(u64::try_from(received.at.as_micros()).expect("fits"));
            if let Some(packet) = self.decoder.next(&mut &[received.byte][..], now) {
                let length = OVERHEAD + packet.payload.len();
                assert_eq!(self.bytes, length, "the hub sent bytes that are no packet, before {packet:02x?}");
                self.bytes = 0;
                arrivals.push(Arrival { at: received.at, packet });
            }
        }
        arrivals
    }

    /// Sends a request, and waits for the answer.
    ///
    /// # Panics
    /// Panics if no answer arrives within 100 ms.
    pub fn ask(&mut self, bench: &mut Bench, id: u16, payload: &[u8]) -> Reply {
        let bytes = self.packet(id, payload);
        bench.send(&bytes);
        let reference = self.message;
        let mut reply = None;
        bench.run_while(Duration::from_micros(200), Duration::from_millis(100), |bench| {
            let mut arrivals = self.arrivals(bench).into_iter();
            reply = arrivals.find(|arrival| arrival.packet.reference == reference);
            reply.is_some()
        });
        let reply = reply.unwrap_or_else(|| panic!("no answer to {bytes:02x?}"));
        Reply::read(&reply.packet, id).unwrap_or_else(|| panic!("{reply:02x?} to {bytes:02x?}"))
    }

    /// Sends a request that the hub must acknowledge.
    ///
    /// # Panics
    /// Panics if the hub refuses the request or does not answer.
    pub fn order(&mut self, bench: &mut Bench, request: impl Into<Request>) {
        let request = request.into();
        let reply = self.ask(bench, request.id(), &request.payload());
        assert!(matches!(reply, Reply::Ack { .. }), "{request:?}: {reply:?}");
    }

    /// Sends a request that the hub must answer with data.
    ///
    /// # Panics
    /// Panics if the hub refuses the request or does not answer.
    pub fn question<A: Field>(&mut self, bench: &mut Bench, request: impl Into<Request>) -> A {
        let request = request.into();
        let reply = self.ask(bench, request.id(), &request.payload());
        let Reply::Data(payload) = reply else { panic!("{request:?}: {reply:?}") };
        A::read(&mut Fields::new(&payload)).unwrap_or_else(|_| panic!("{request:?}: {payload:02x?}"))
    }

    /// Sends the hub a keep-alive.
    pub fn keep_alive(&mut self, bench: &mut Bench) {
        self.order(bench, Standard::KeepAlive);
    }

    /// Sets the run mode of a motor, which brakes at power 0.
    pub fn set_mode(&mut self, bench: &mut Bench, motor: u8, mode: RunMode) {
        self.order(bench, ToMotor::SetMode { mode: ChannelMode { mode, floats: false } }.to(motor));
    }

    /// Enables or disables a motor.
    pub fn enable(&mut self, bench: &mut Bench, motor: u8, on: bool) {
        self.order(bench, ToMotor::SetEnable { on }.to(motor));
    }

    /// Regulates the velocity of a motor, in counts/s: sets mode and set-point, and enables the motor.
    pub fn velocity(&mut self, bench: &mut Bench, motor: u8, cps: i16) {
        self.set_mode(bench, motor, RunMode::Velocity);
        self.order(bench, ToMotor::SetVelocity { cps }.to(motor));
        self.enable(bench, motor, true);
    }

    /// Applies constant power to a motor, -32767 to 32767: sets mode and set-point, and enables the motor.
    pub fn power(&mut self, bench: &mut Bench, motor: u8, power: i16) {
        self.set_mode(bench, motor, RunMode::Power);
        self.order(bench, ToMotor::SetPower { power: Control::new(power) }.to(motor));
        self.enable(bench, motor, true);
    }

    /// Moves a motor to a position in counts, with a speed limit in counts/s: sets mode and set-point, and enables the motor.
    pub fn position(&mut self, bench: &mut Bench, motor: u8, counts: i32, tolerance: u16, limit: i16) {
        self.order(bench, ToMotor::SetVelocity { cps: limit }.to(motor));
        self.order(bench, ToMotor::SetPosition { target: Target { counts, tolerance } }.to(motor));
        self.set_mode(bench, motor, RunMode::Position);
        self.enable(bench, motor, true);
    }

    /// Returns all measurements of the hub, which it sends in one answer.
    pub fn bulk(&mut self, bench: &mut Bench) -> Bulk {
        self.question(bench, ToHub::Bulk)
    }
}
