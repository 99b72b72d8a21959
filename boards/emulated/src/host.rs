//! A host on the serial line: speaks the REV Hub Serial Protocol to the firmware, packet by packet.
//!
//! Written from the protocol's published facts, apart from the firmware's own implementation, so that the
//! two check each other. Little-endian; a packet is `44 4B`, its length, destination, source, message
//! number, reference, type, payload, and the sum of all bytes before it.

use std::time::Duration;

use crate::bench::Bench;

/// First function of the interface DEKA.
const DEKA: u16 = 0x1000;

/// What a hub answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Done.
    Ack {
        /// There is something to fetch with the module status.
        attention: bool,
    },
    /// Refused, with the protocol's reason.
    Nack(u8),
    /// What was asked for.
    Data(Vec<u8>),
}

/// A packet that arrived, with the instant of its last byte.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Packet {
    /// When its last stop bit ended.
    pub at: Duration,
    /// Type, without the bit that marks an answer.
    pub kind: u16,
    /// Message number of the request that it answers.
    pub reference: u8,
    /// Payload.
    pub payload: Vec<u8>,
}

/// A motor channel's mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Open loop.
    ConstantPower = 0,
    /// Regulated velocity.
    Velocity = 1,
    /// Regulated position.
    Position = 2,
}

/// The answer to a bulk read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bulk {
    /// Counts by motor.
    pub encoders: [i32; 4],
    /// Counts/s by motor.
    pub velocities: [i16; 4],
    /// At target, by motor.
    pub at_target: [bool; 4],
    /// There is something to fetch with the module status.
    pub attention: bool,
}

/// The host's end of the line.
#[derive(Debug)]
pub struct Host {
    address: u8,
    message: u8,
    pending: Vec<(Duration, u8)>,
}

impl Default for Host {
    fn default() -> Self {
        Self::new(2)
    }
}

impl Host {
    /// Talks to the hub at this address; 2 is the firmware's own.
    #[must_use]
    pub const fn new(address: u8) -> Self {
        Self { address, message: 0, pending: Vec::new() }
    }

    /// The bytes of the next request.
    pub fn packet(&mut self, kind: u16, payload: &[u8]) -> Vec<u8> {
        self.message = self.message.checked_add(1).unwrap_or(1);
        let length = u16::try_from(11 + payload.len()).expect("a short payload").to_le_bytes();
        let kind = kind.to_le_bytes();
        let mut bytes = vec![0x44, 0x4B, length[0], length[1], self.address, 0, self.message, 0];
        bytes.extend_from_slice(&kind);
        bytes.extend_from_slice(payload);
        bytes.push(bytes.iter().fold(0, |sum: u8, &byte| sum.wrapping_add(byte)));
        bytes
    }

    /// Every whole packet that has come so far.
    pub fn arrivals(&mut self, bench: &mut Bench) -> Vec<Packet> {
        self.pending.extend(bench.receive().into_iter().map(|byte| (byte.at, byte.byte)));
        let mut packets = Vec::new();
        loop {
            let bytes: Vec<u8> = self.pending.iter().map(|&(_, byte)| byte).collect();
            let Some(start) = bytes.windows(2).position(|pair| pair == [0x44, 0x4B]) else {
                return packets;
            };
            let packet = &bytes[start..];
            if packet.len() < 11 {
                return packets;
            }
            let length = usize::from(u16::from_le_bytes([packet[2], packet[3]]));
            if packet.len() < length {
                return packets;
            }
            let sum = packet[..length - 1].iter().fold(0, |sum: u8, &byte| sum.wrapping_add(byte));
            assert_eq!(sum, packet[length - 1], "the hub sent a bad checksum: {packet:02x?}");
            assert_eq!(start, 0, "the hub sent bytes between packets: {bytes:02x?}");
            packets.push(Packet {
                at: self.pending[length - 1].0,
                kind: u16::from_le_bytes([packet[8], packet[9]]) & 0x7FFF,
                reference: packet[7],
                payload: packet[10..length - 1].to_vec(),
            });
            // Answers are told from ACK and NACK by their type.
            self.pending.drain(..length);
        }
    }

    /// Asks and waits for the answer.
    ///
    /// # Panics
    /// If none comes within 100 ms.
    pub fn ask(&mut self, bench: &mut Bench, kind: u16, payload: &[u8]) -> Reply {
        let bytes = self.packet(kind, payload);
        bench.send(&bytes);
        let reference = self.message;
        let mut reply = None;
        bench.run_while(Duration::from_micros(200), Duration::from_millis(100), |bench| {
            reply = self.arrivals(bench).into_iter().find(|packet| packet.reference == reference);
            reply.is_some()
        });
        let packet = reply.unwrap_or_else(|| panic!("no answer to {bytes:02x?}"));
        match (packet.kind, packet.payload.as_slice()) {
            (0x7F01, &[attention]) => Reply::Ack { attention: attention != 0 },
            (0x7F02, &[reason]) => Reply::Nack(reason),
            _ => Reply::Data(packet.payload),
        }
    }

    /// A command of the interface DEKA that must be obeyed.
    ///
    /// # Panics
    /// If it is not.
    pub fn order(&mut self, bench: &mut Bench, function: u16, payload: &[u8]) {
        let reply = self.ask(bench, DEKA + function, payload);
        assert!(matches!(reply, Reply::Ack { .. }), "function {function} {payload:02x?}: {reply:?}");
    }

    /// A question of the interface DEKA that must be answered.
    ///
    /// # Panics
    /// If it is not.
    pub fn question(&mut self, bench: &mut Bench, function: u16, payload: &[u8]) -> Vec<u8> {
        match self.ask(bench, DEKA + function, payload) {
            Reply::Data(data) => data,
            other => panic!("function {function} {payload:02x?}: {other:?}"),
        }
    }

    /// Tells the hub that somebody is there.
    pub fn keep_alive(&mut self, bench: &mut Bench) {
        assert!(matches!(self.ask(bench, 0x7F04, &[]), Reply::Ack { .. }));
    }

    /// Mode, and brake at zero.
    pub fn set_mode(&mut self, bench: &mut Bench, motor: u8, mode: Mode) {
        self.order(bench, 8, &[motor, mode as u8, 0]);
    }

    /// Enables or disables a motor.
    pub fn enable(&mut self, bench: &mut Bench, motor: u8, enabled: bool) {
        self.order(bench, 10, &[motor, u8::from(enabled)]);
    }

    /// A set-point of regulated velocity, counts/s, with mode and enable.
    pub fn velocity(&mut self, bench: &mut Bench, motor: u8, target: i16) {
        self.set_mode(bench, motor, Mode::Velocity);
        let [low, high] = target.to_le_bytes();
        self.order(bench, 17, &[motor, low, high]);
        self.enable(bench, motor, true);
    }

    /// A set-point of constant power, with mode and enable.
    pub fn power(&mut self, bench: &mut Bench, motor: u8, power: i16) {
        self.set_mode(bench, motor, Mode::ConstantPower);
        let [low, high] = power.to_le_bytes();
        self.order(bench, 15, &[motor, low, high]);
        self.enable(bench, motor, true);
    }

    /// A set-point of regulated position with its speed limit, with mode and enable.
    pub fn position(&mut self, bench: &mut Bench, motor: u8, target: i32, tolerance: u16, limit: i16) {
        let [low, high] = limit.to_le_bytes();
        self.order(bench, 17, &[motor, low, high]);
        let mut payload = vec![motor];
        payload.extend(target.to_le_bytes());
        payload.extend(tolerance.to_le_bytes());
        self.order(bench, 19, &payload);
        self.set_mode(bench, motor, Mode::Position);
        self.enable(bench, motor, true);
    }

    /// Everything that the hub measures at once.
    ///
    /// # Panics
    /// If the answer has another length.
    pub fn bulk(&mut self, bench: &mut Bench) -> Bulk {
        let data = self.question(bench, 0, &[]);
        assert_eq!(data.len(), 35, "{data:02x?}");
        let word = |at: usize| i32::from_le_bytes([data[at], data[at + 1], data[at + 2], data[at + 3]]);
        let half = |at: usize| i16::from_le_bytes([data[at], data[at + 1]]);
        Bulk {
            encoders: core::array::from_fn(|motor| word(1 + 4 * motor)),
            velocities: core::array::from_fn(|motor| half(18 + 2 * motor)),
            at_target: core::array::from_fn(|motor| data[17] & 0x10 << motor != 0),
            attention: data[34] != 0,
        }
    }
}
