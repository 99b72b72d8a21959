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
use motor_hub::extension::settings::{Group, MotorSettings, Values};
use motor_hub::motor::Settings;
use motor_hub::protocol::answers::{Bulk, Reply};
use motor_hub::protocol::frame::{self, Decoder, OVERHEAD, Packet};
use motor_hub::protocol::motor::{ChannelMode, RunMode, Target, ToMotor};
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::requests::{AdcChannel, Standard, ToHub};
use motor_hub::protocol::{Address, HOST};
use motor_hub::units::{Control, Micros};

use crate::bench::Bench;

/// What the host is connected to: a hub, or the parent of a chain.
pub trait Line {
    /// Returns the hub that the host is connected to.
    fn first(&mut self) -> &mut Bench;
    /// Runs for some virtual time.
    fn run(&mut self, time: Duration);
}

impl Line for Bench {
    fn first(&mut self) -> &mut Bench {
        self
    }

    fn run(&mut self, time: Duration) {
        Self::run(self, time);
    }
}

/// A packet that arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// Time at which the last stop bit ended.
    pub at: Duration,
    /// The packet.
    pub packet: Packet,
}

/// Time of a byte on the line: ten bits at 460 800 baud.
pub(crate) const BYTE: Duration = Duration::from_nanos(21_701);

/// The host's end of the line.
///
/// # Panics
/// Methods that wait for an answer panic if no answer arrives within 100 ms, or another answer than they need.
#[derive(Debug)]
pub struct HostLink {
    address: u8,
    message: u8,
    decoder: Decoder,
    /// Number of bytes received since the last packet.
    bytes: usize,
}

impl Default for HostLink {
    fn default() -> Self {
        Self { address: Address::DEFAULT.get(), message: 0, decoder: Decoder::new(), bytes: 0 }
    }
}

impl HostLink {
    /// Addresses the next requests to the hub with this address.
    pub const fn to(&mut self, address: u8) -> &mut Self {
        self.address = address;
        self
    }

    /// Returns the bytes of the next packet. The payload may have any content.
    pub fn packet(&mut self, id: u16, payload: &[u8]) -> Vec<u8> {
        self.message = self.message.checked_add(1).unwrap_or(1);
        let payload = payload.try_into().expect("a short payload");
        let (destination, number) = (self.address, self.message);
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

    /// Sends a request. Returns the time at which its last byte has arrived.
    pub fn send(&mut self, line: &mut impl Line, request: impl Into<Request>) -> Duration {
        let request = request.into();
        self.send_raw(line, request.id(), &request.payload())
    }

    /// Sends a request whose payload may have any content. Returns the time at which its last byte has arrived.
    pub fn send_raw(&mut self, line: &mut impl Line, id: u16, payload: &[u8]) -> Duration {
        let bytes = self.packet(id, payload);
        line.first().send(&bytes);
        line.first().now() + BYTE * u32::try_from(bytes.len()).expect("a short packet")
    }

    /// Sends a request. Returns its answer, and the time from the end of the request to the end of the answer. Returns `None` if no
    /// answer arrives within 100 ms.
    pub fn timed(&mut self, line: &mut impl Line, request: impl Into<Request>) -> Option<(Packet, Duration)> {
        let sent = self.send(line, request);
        self.answer(line, sent)
    }

    fn answer(&mut self, line: &mut impl Line, sent: Duration) -> Option<(Packet, Duration)> {
        let (source, reference) = (self.address, self.message);
        (0..500).find_map(|_| {
            line.run(Duration::from_micros(200));
            let mut arrivals = self.arrivals(line.first()).into_iter();
            let arrival = arrivals
                .find(|Arrival { packet, .. }| packet.source == source && packet.reference == reference)?;
            Some((arrival.packet, arrival.at.saturating_sub(sent)))
        })
    }

    /// Sends a request, and waits for the answer.
    pub fn request(&mut self, line: &mut impl Line, request: impl Into<Request>) -> Reply {
        let request = request.into();
        self.request_raw(line, request.id(), &request.payload())
    }

    /// Sends a request whose payload may have any content, and waits for the answer.
    pub fn request_raw(&mut self, line: &mut impl Line, id: u16, payload: &[u8]) -> Reply {
        let request = format!("request {id:#06x} {payload:02x?} to address {}", self.address);
        let sent = self.send_raw(line, id, payload);
        let (packet, _) = self.answer(line, sent).unwrap_or_else(|| panic!("no answer to {request}"));
        Reply::read(&packet, id).unwrap_or_else(|| panic!("{packet:02x?} to {request}"))
    }

    /// Sends a request that the hub must acknowledge.
    pub fn command(&mut self, line: &mut impl Line, request: impl Into<Request>) {
        let request = request.into();
        let reply = self.request(line, request.clone());
        assert!(matches!(reply, Reply::Ack { .. }), "{request:?}: {reply:?}");
    }

    /// Sends a request that the hub must answer with data.
    pub fn read<A: Field>(&mut self, line: &mut impl Line, request: impl Into<Request>) -> A {
        let request = request.into();
        let reply = self.request(line, request.clone());
        let Reply::Data(payload) = reply else { panic!("{request:?}: {reply:?}") };
        A::read(&mut Fields::new(&payload)).unwrap_or_else(|_| panic!("{request:?}: {payload:02x?}"))
    }

    /// Sends the hub a keep-alive.
    pub fn keep_alive(&mut self, line: &mut impl Line) {
        self.command(line, Standard::KeepAlive);
    }

    /// Sends one group of a motor's settings.
    pub fn set(&mut self, line: &mut impl Line, motor: u8, group: Group, settings: Settings) {
        self.command(line, Request::Set(motor, Values::of(group, &MotorSettings::new(settings))));
    }

    /// Sets the run mode of a motor, which brakes at power 0.
    pub fn set_mode(&mut self, line: &mut impl Line, motor: u8, mode: RunMode) {
        self.command(line, ToMotor::SetMode { mode: ChannelMode { mode, floats: false } }.to(motor));
    }

    /// Enables or disables a motor.
    pub fn enable(&mut self, line: &mut impl Line, motor: u8, on: bool) {
        self.command(line, ToMotor::SetEnable { on }.to(motor));
    }

    /// Regulates the velocity of a motor, in counts/s: sets mode and set-point, and enables the motor.
    pub fn velocity(&mut self, line: &mut impl Line, motor: u8, cps: i16) {
        self.set_mode(line, motor, RunMode::Velocity);
        self.command(line, ToMotor::SetVelocity { cps }.to(motor));
        self.enable(line, motor, true);
    }

    /// Applies constant power to a motor, -32767 to 32767: sets mode and set-point, and enables the motor.
    pub fn power(&mut self, line: &mut impl Line, motor: u8, power: i16) {
        self.set_mode(line, motor, RunMode::Power);
        self.command(line, ToMotor::SetPower { power: Control::new(power) }.to(motor));
        self.enable(line, motor, true);
    }

    /// Moves a motor to a position in counts, with a speed limit in counts/s: sets mode and set-point, and enables the motor.
    pub fn position(&mut self, line: &mut impl Line, motor: u8, counts: i32, tolerance: u16, limit: i16) {
        self.command(line, ToMotor::SetVelocity { cps: limit }.to(motor));
        self.command(line, ToMotor::SetPosition { target: Target { counts, tolerance } }.to(motor));
        self.set_mode(line, motor, RunMode::Position);
        self.enable(line, motor, true);
    }

    /// Returns the hub's measurement of an analog channel, in the channel's unit.
    pub fn analog(&mut self, line: &mut impl Line, channel: AdcChannel) -> i16 {
        self.read(line, ToHub::Adc { channel, raw: false })
    }

    /// Returns all measurements of the hub, which it sends in one answer.
    pub fn bulk(&mut self, line: &mut impl Line) -> Bulk {
        self.read(line, ToHub::Bulk)
    }
}
