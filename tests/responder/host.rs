//! A host that exchanges packets with a responder, without tasks and clock. The tests of the responder use it.
#![allow(dead_code, reason = "each test uses its own part")]

use motor_hub::board::Equipment;
use motor_hub::braking::Winding;
use motor_hub::extension::report::{HubReport, MotorReport};
use motor_hub::extension::settings::{Field as Setting, Form, Group};
use motor_hub::extension::{HubFunction, Request};
use motor_hub::hub::{Command, Snapshot};
use motor_hub::motor::{Setpoint, Settings};
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::requests::FIRST_FUNCTION;
use motor_hub::protocol::{Address, Decoder, Packet, frame};
use motor_hub::record::Record;
use motor_hub::responder::{Line, Responder};
use motor_hub::supply::DrawStage;
use motor_hub::units::{Micros, Millivolts};
use motor_hub::update::{Booted, Slot, SlotReport};

pub(crate) const N: usize = 4;
pub(crate) const HUB: u8 = 3;

/// A slot for new firmware.
pub(crate) const SLOT: Slot =
    Slot { origin: 0x0802_0000, length: 512 * 1024, ram: (0x2000_0000, 0x2002_0000), signer: None };

/// A NeveRest 60.
pub(crate) fn settings() -> Settings {
    Settings::new(Winding::NEVEREST_60)
}

pub(crate) fn responder_with(settings: Settings) -> Responder<N> {
    Responder::new(Address::new(HUB).expect("an address"), [settings; N])
}

pub(crate) fn bytes_of(hex: &str) -> Vec<u8> {
    hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).expect("hex")).collect()
}

pub(crate) fn frame_to(destination: u8, number: u8, id: u16, payload: &[u8]) -> Vec<u8> {
    let mut frame = vec![0x44, 0x4B];
    frame.extend((11 + payload.len() as u16).to_le_bytes());
    frame.extend([destination, 0, number, 0]);
    frame.extend(id.to_le_bytes());
    frame.extend(payload);
    frame.push(frame.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)));
    frame
}

/// Returns the largest raw value of a setting: of its last word or of its largest number.
pub(crate) fn largest(setting: &Setting) -> i64 {
    match setting.form {
        Form::Words(words) => words.len() as i64 - 1,
        Form::Steps(_) => setting.raw_of(setting.range().1).expect("in range"),
    }
}

/// Answer of the hub.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Answer {
    /// An acknowledgement, with its attention flag.
    Ack(u8),
    Nack(u8),
    Data(Vec<u8>),
}

impl Answer {
    /// The bytes of a data response.
    pub(crate) fn data(self) -> Vec<u8> {
        let Self::Data(bytes) = self else { panic!("{self:?}") };
        bytes
    }

    /// Asserts that the request was acknowledged.
    pub(crate) fn done(self) {
        assert!(matches!(self, Self::Ack(_)), "{self:?}");
    }
}

/// All devices that a board can have besides motors.
pub(crate) const FULL: Equipment =
    Equipment { digital: 0xFF, servos: 6, analog: 4, i2c: 4, rail: true, temperature: true };

/// Requests that command nothing to motor 1, which is enabled in mode power: *set enable*, and the targets of the other
/// modes.
pub(crate) const WITHOUT_COMMAND: [(u16, &[u8]); 3] =
    [(10, &[1, 1]), (17, &[1, 100, 0]), (19, &[1, 100, 0, 0, 0, 5, 0])];

pub(crate) struct TestHost {
    pub(crate) responder: Responder<N>,
    pub(crate) decoder: Decoder,
    pub(crate) now: Micros,
    pub(crate) snapshot: Snapshot<N>,
    pub(crate) number: u8,
    /// Number of the newest command.
    pub(crate) commands: u32,
    pub(crate) record: Option<Record<'static>>,
}

impl TestHost {
    /// Creates a host at a hub with all devices, just after the hub's reset. The battery has 12.345 V.
    pub(crate) fn new() -> Self {
        let battery = Some(Millivolts::new(12_345));
        let snapshot = Snapshot { battery, draw_stage: DrawStage::Full, ..Snapshot::INITIAL };
        let mut responder = responder_with(settings());
        responder.outputs.equipment = FULL;
        Self {
            responder,
            decoder: Decoder::new(),
            now: Micros::new(1_000_000),
            snapshot,
            number: 0,
            commands: 0,
            record: None,
        }
    }

    /// Creates a host at a hub whose attention flag is cleared.
    pub(crate) fn settled() -> Self {
        let mut host = Self::new();
        assert_eq!(host.ask(0x7F03, &[1]), Answer::Data(vec![2, 0]));
        host
    }

    /// Sends bytes. Returns the frames that the hub sends back.
    pub(crate) fn send(&mut self, mut bytes: &[u8]) -> Vec<Vec<u8>> {
        let mut replies = Vec::new();
        while let Some(packet) = self.decoder.next(&mut bytes, self.now) {
            let record = self.record.as_mut();
            let reply = self.responder.receive_with(&packet, Line::Host, self.now, &self.snapshot, record);
            replies.extend(reply.map(|reply| frame::encode(&reply).to_vec()));
        }
        replies
    }

    /// Sends a request to the hub. Returns its answer.
    pub(crate) fn ask(&mut self, id: u16, payload: &[u8]) -> Answer {
        let address = self.responder.address().get();
        self.number = self.number.wrapping_add(1);
        let replies = self.send(&frame_to(address, self.number, id, payload));
        let [reply] = replies.as_slice() else { panic!("{id:#06x} {payload:x?}: {replies:x?}") };
        let packet = decode(reply);
        assert_eq!((packet.destination, packet.source, packet.reference), (0, address, self.number));
        match packet.id {
            0x7F01 => Answer::Ack(packet.payload[0]),
            0x7F02 => Answer::Nack(packet.payload[0]),
            other => {
                assert_eq!(other, id | 0x8000);
                Answer::Data(packet.payload.to_vec())
            }
        }
    }

    /// Calls a function of the motor interface.
    pub(crate) fn call(&mut self, function: u16, payload: &[u8]) -> Answer {
        self.ask(FIRST_FUNCTION + function, payload)
    }

    /// Asks for a group of a motor's settings. Returns the bytes without the fields that a later version has added to the
    /// group.
    pub(crate) fn group(&mut self, id: u16, motor: u8) -> Vec<u8> {
        let group = Group::ALL.into_iter().find(|group| group.get_id() == id).expect("a group");
        let mut bytes = self.ask(id, &[motor]).data();
        let first = group.fields().iter().filter(|field| field.since.is_none());
        bytes.truncate(first.map(|field| field.size).sum());
        bytes
    }

    pub(crate) fn request(&mut self, request: impl Into<Request>) -> Answer {
        let request = request.into();
        self.ask(request.id(), &request.payload())
    }

    /// Sends a request. Returns the fields of its answer.
    pub(crate) fn read<T: Field>(&mut self, request: impl Into<Request>) -> T {
        T::read(&mut Fields::new(&self.request(request).data())).expect("an answer")
    }

    /// The hub's own report.
    pub(crate) fn report(&mut self) -> HubReport {
        self.read(HubFunction::Report)
    }

    /// A motor's part of the hub's own report.
    pub(crate) fn reported(&mut self, motor: usize) -> MotorReport {
        self.report().motors[motor]
    }

    pub(crate) fn do_all(&mut self, calls: &[(u16, &[u8])]) {
        for (function, payload) in calls {
            let said = self.call(*function, payload);
            assert!(matches!(said, Answer::Ack(_)), "{function} {payload:?}: {said:?}");
        }
    }

    /// The commands to the motors since the last call. No snapshot includes them before [`tick`](Self::tick).
    pub(crate) fn new_commands(&mut self) -> Vec<Command> {
        std::iter::from_fn(|| {
            let command = self.responder.pending()?;
            self.commands = self.commands.wrapping_add(1);
            self.responder.sent(self.commands);
            Some(command)
        })
        .collect()
    }

    /// The settings of the motors since the last call, when the host has sent nothing else.
    pub(crate) fn new_settings(&mut self) -> Vec<Settings> {
        let settings = |command| match command {
            Command::Configure { settings, .. } => settings,
            other => panic!("{other:?}"),
        };
        self.new_commands().into_iter().map(settings).collect()
    }

    /// A control tick: the next snapshot includes all commands that were sent.
    pub(crate) fn tick(&mut self) {
        self.snapshot.newest_command = self.commands;
    }

    /// Asserts that the hub gives this answer until a snapshot includes all commands, however many ticks pass before.
    pub(crate) fn expect_until_included<T: PartialEq + std::fmt::Debug>(
        &mut self,
        mut ask: impl FnMut(&mut Self) -> T,
        answer: T,
    ) {
        assert_eq!(ask(self), answer, "not sent yet");
        self.new_commands();
        for _ in 0..3 {
            self.snapshot.tick += 1;
            assert_eq!(ask(self), answer, "in no snapshot yet");
        }
        self.tick();
    }

    /// Sets the battery voltage in mV and the stage of the draw that the hub has measured.
    pub(crate) fn set_battery(&mut self, millivolts: Option<u16>, stage: DrawStage) {
        self.snapshot.battery = millivolts.map(Millivolts::new);
        self.snapshot.draw_stage = stage;
    }

    pub(crate) fn wait_ms(&mut self, ms: u64) {
        self.now = Micros::new(self.now.get() + ms * 1000);
    }
}

/// The one packet in a frame.
pub(crate) fn decode(mut frame: &[u8]) -> Packet {
    let packet = Decoder::new().next(&mut frame, Micros::new(0)).expect("a whole frame");
    assert!(frame.is_empty());
    packet
}

/// All frames in a stream, also frames that overlap: the position of each frame, and its bytes.
pub(crate) fn frames_in(bytes: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    bytes.windows(2).enumerate().filter(|(_, pair)| pair == b"\x44\x4B").filter_map(|(at, _)| {
        let rest = &bytes[at..];
        let length = usize::from(u16::from_le_bytes([*rest.get(2)?, *rest.get(3)?]));
        let frame = rest.get(..length).filter(|frame| (11..=frame::LONGEST).contains(&frame.len()))?;
        let (sum, summed) = frame.split_last()?;
        (summed.iter().fold(0u8, |sum, byte| sum.wrapping_add(*byte)) == *sum).then_some((at, frame))
    })
}

/// True for a frame that may enable a motor.
pub(crate) fn enables(frame: &[u8]) -> bool {
    frame[8..10] == [0x0A, 0x10] && frame.len() >= 13 && frame[11] == 1
}

/// What happens on the line.
#[derive(Clone, Debug)]
pub(crate) enum Event {
    /// Bytes arrive, in pieces of this length.
    Bytes(Vec<u8>, usize),
    /// Milliseconds pass.
    Pause(u16),
}

/// Sends the events to a fresh hub. No motor may run unless a frame has enabled it, and a keep-alive at the end must be
/// answered.
pub(crate) fn survive(events: &[Event]) {
    let mut host = TestHost::settled();
    // The hub also has a slot for new firmware.
    host.responder = host.responder.with_slot(SLOT);
    host.responder.update_done(SlotReport::Booted(Booted::Confirmed));
    let mut stream = Vec::new();
    let mut commands = Vec::new();
    for event in events {
        match event {
            Event::Bytes(bytes, piece) => {
                stream.extend(bytes);
                for piece in bytes.chunks((*piece).max(1)) {
                    host.send(piece);
                }
            }
            Event::Pause(ms) => {
                host.wait_ms(u64::from(*ms));
                host.send(&[]);
                host.responder.tick(host.now, &host.snapshot);
            }
        }
        commands.extend(host.new_commands());
    }
    if !frames_in(&stream).any(|(_, frame)| enables(frame)) {
        let at_rest = |c: &Command| {
            matches!(
                c,
                Command::Set { setpoint: Setpoint::Disabled, .. }
                    | Command::Configure { .. }
                    | Command::SetBase(_)
            )
        };
        assert!(commands.iter().all(at_rest), "{commands:?}");
        assert_eq!(host.responder.enabled(), [false; N]);
    }

    let keep_alive = |host: &TestHost| frame_to(host.responder.address().get(), 99, 0x7F04, &[]);
    let answers = |replies: Vec<Vec<u8>>| replies.last().map(|reply| reply[7..10].to_vec());
    let answered = Some(vec![99, 0x01, 0x7F]);
    // The hub answers immediately. There are two exceptions: the end of the stream and the beginning of the packet form
    // another frame, or a frame in the stream changes the address.
    let address = host.responder.address();
    let packet = keep_alive(&host);
    let end = stream.len();
    stream.extend(&packet);
    let hidden = frames_in(&stream).any(|(at, frame)| at < end && at + frame.len() > end);
    let mut replies = host.send(&packet);
    host.wait_ms(50);
    replies.extend(host.send(&[]));
    if !hidden && host.responder.address() == address {
        assert_eq!(answers(replies), answered);
    }
    // After a silence every packet is answered.
    host.wait_ms(50);
    host.send(&[]);
    let packet = keep_alive(&host);
    assert_eq!(answers(host.send(&packet)), answered);
}
