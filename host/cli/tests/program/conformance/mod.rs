//! A host that checks every rule of the protocol that hosts rely on, from outside and in real time. Written
//! apart from the hub's and the client's codecs, so that each checks the other.

use crate::common::wait_for;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Default address of a hub.
pub(crate) const HUB: u8 = 2;

const DEKA: u16 = 0x1000;

pub(crate) const KEEP_ALIVE: u16 = 0x7F04;
const STATUS: u16 = 0x7F03;
const SET_ENABLE: u16 = DEKA + 10;
const GET_ENABLE: u16 = DEKA + 11;
const SET_POWER: u16 = DEKA + 15;
const ENCODER: u16 = DEKA + 22;

/// The folder in which hubs of tests leave notes, so that no `scan` of a user finds them.
pub(crate) fn notes() -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("notes");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A hub that a process of its own serves.
pub(crate) struct Hub {
    process: Child,
    pub(crate) place: String,
}

impl Hub {
    /// The simulated hub on a TCP port.
    pub(crate) fn served() -> Self {
        Self::served_with(&[])
    }

    /// A hub on a TCP port, with more options.
    pub(crate) fn served_with(options: &[&str]) -> Self {
        Self::start(&[&["--tcp", "127.0.0.1:0"], options].concat())
    }

    /// A hub with all of its options.
    pub(crate) fn start(options: &[&str]) -> Self {
        Self::start_in(&notes(), options, Stdio::inherit())
    }

    /// A hub on a TCP port that leaves its note in a folder, and its standard error.
    pub(crate) fn start_heard(notes: &Path) -> (Self, BufReader<ChildStderr>) {
        let mut hub = Self::start_in(notes, &["--tcp", "127.0.0.1:0"], Stdio::piped());
        let errors = hub.process.stderr.take().unwrap();
        (hub, BufReader::new(errors))
    }

    /// A hub that leaves its note in a folder, and writes its errors to `errors`.
    pub(crate) fn start_in(notes: &Path, options: &[&str], errors: Stdio) -> Self {
        let mut served = Command::new(env!("CARGO_BIN_EXE_motor-hub"));
        served.arg("serve").args(options).env("XDG_RUNTIME_DIR", notes);
        let mut process = served.stdout(Stdio::piped()).stderr(errors).spawn().unwrap();
        let mut place = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut place).unwrap();
        Self { process, place: place.trim().to_owned() }
    }

    pub(crate) fn id(&self) -> u32 {
        self.process.id()
    }

    /// Waits until the program has ended.
    pub(crate) fn wait(&mut self) -> ExitStatus {
        self.process.wait().unwrap()
    }

    pub(crate) fn serial(&self) -> Host<Box<dyn serialport::SerialPort>> {
        let open = || serialport::new(&self.place, 460_800).timeout(PATIENCE).open();
        // Another test may start a program at this moment. Between fork and exec the new process also holds the port
        // that was just closed, and the lock of the port. Opening the port is therefore tried several times.
        Host::new(wait_for("an open port", || open().ok()))
    }

    pub(crate) fn tcp(&self) -> Host<TcpStream> {
        let stream = TcpStream::connect(&self.place).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        stream.set_nodelay(true).unwrap();
        Host::new(stream)
    }
}

impl Drop for Hub {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
        // The killed program could not remove its note.
        let _ = std::fs::remove_file(notes().join("motor-hub").join(self.id().to_string()));
    }
}

/// A silence of this length is the hub's answer, not a delay.
const PATIENCE: Duration = Duration::from_millis(150);

#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Reply {
    Ack(bool),
    Nack(u8),
    Data(Vec<u8>),
}

pub(crate) use Reply::{Ack, Data, Nack};

pub(crate) struct Host<L> {
    line: L,
    pub(crate) number: u8,
}

pub(crate) fn packet(to: u8, number: u8, kind: u16, payload: &[u8]) -> Vec<u8> {
    let length = (11 + payload.len() as u16).to_le_bytes();
    let kind = kind.to_le_bytes();
    let mut bytes = vec![0x44, 0x4B, length[0], length[1], to, 0, number, 0, kind[0], kind[1]];
    bytes.extend(payload);
    bytes.push(bytes.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
    bytes
}

impl<L: Read + Write> Host<L> {
    fn new(line: L) -> Self {
        Self { line, number: 0 }
    }

    /// All bytes until the line is silent.
    pub(crate) fn receive_all(&mut self) -> Vec<u8> {
        let (mut received, mut chunk) = (Vec::new(), [0; 512]);
        while let Ok(length @ 1..) = self.line.read(&mut chunk) {
            received.extend(&chunk[..length]);
        }
        received
    }

    pub(crate) fn send(&mut self, bytes: &[u8]) {
        self.line.write_all(bytes).unwrap();
        self.line.flush().unwrap();
    }

    /// Reads this number of bytes within 2 s, a time that a busy machine also keeps.
    fn take(&mut self, length: usize) -> Option<Vec<u8>> {
        let (mut bytes, mut read) = (vec![0; length], 0);
        let end = Instant::now() + Duration::from_secs(2);
        while read < length {
            match self.line.read(&mut bytes[read..]) {
                Ok(more @ 1..) => read += more,
                _ if Instant::now() < end => (),
                _ => return None,
            }
        }
        Some(bytes)
    }

    /// Reads one packet, and checks all of it except the payload.
    pub(crate) fn reply(&mut self) -> Option<(u16, Reply, u8)> {
        let mut bytes = self.take(11)?;
        assert_eq!(bytes[..2], [0x44, 0x4B], "{bytes:02x?}");
        let length = usize::from(u16::from_le_bytes([bytes[2], bytes[3]]));
        bytes.extend(self.take(length - 11).unwrap());
        let (sum, body) = bytes.split_last().unwrap();
        assert_eq!(body.iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)), *sum, "{bytes:02x?}");
        assert_eq!(bytes[4], 0, "to the host: {bytes:02x?}");
        let (kind, payload) = (u16::from_le_bytes([bytes[8], bytes[9]]), &body[10..]);
        let reply = match (kind, payload) {
            (0x7F01, &[attention]) => Ack(attention != 0),
            (0x7F02, &[reason]) => Nack(reason),
            (0x7F01 | 0x7F02, _) => panic!("{bytes:02x?}"),
            _ => Data(payload.to_vec()),
        };
        assert_eq!((bytes[5], bytes[7]), (HUB, self.number), "source and reference: {bytes:02x?}");
        Some((kind & 0x7FFF, reply, bytes[6]))
    }

    pub(crate) fn ask(&mut self, kind: u16, payload: &[u8]) -> Reply {
        self.number = self.number.wrapping_add(1);
        let number = self.number;
        self.ask_as(number, kind, payload)
    }

    fn ask_as(&mut self, number: u8, kind: u16, payload: &[u8]) -> Reply {
        self.number = number;
        self.send(&packet(HUB, number, kind, payload));
        let (answered, reply, _) =
            self.reply().unwrap_or_else(|| panic!("no reply to {kind:04x} {payload:02x?}"));
        assert!(!matches!(reply, Data(_)) || answered == kind, "{kind:04x} {reply:?}");
        reply
    }

    /// Sends a command that the hub must acknowledge, and returns the attention bit.
    pub(crate) fn order(&mut self, kind: u16, payload: &[u8]) -> bool {
        match self.ask(kind, payload) {
            Ack(attention) => attention,
            other => panic!("{kind:04x} {payload:02x?}: {other:?}"),
        }
    }

    fn data(&mut self, kind: u16, payload: &[u8]) -> Vec<u8> {
        match self.ask(kind, payload) {
            Data(data) => data,
            other => panic!("{kind:04x} {payload:02x?}: {other:?}"),
        }
    }

    /// Checks that the hub does not answer these bytes.
    pub(crate) fn is_ignored(&mut self, bytes: &[u8]) {
        self.send(bytes);
        let received = self.receive_all();
        assert!(received.is_empty(), "{bytes:02x?} was answered {received:02x?}");
    }

    pub(crate) fn enabled(&mut self) -> bool {
        self.data(GET_ENABLE, &[0]) == [1]
    }

    fn counts(&mut self, motor: u8) -> i32 {
        i32::from_le_bytes(self.data(ENCODER, &[motor]).try_into().unwrap())
    }
}

/// Checks framing: packets in any order and at any speed, broken packets, and noise.
fn packets_are_found_and_answered(host: &mut Host<impl Read + Write>) {
    assert!(host.receive_all().is_empty(), "the hub sends nothing on its own");
    // The attention bit is set until the reset has been read and cleared. A parameter other than 0 or 1 is refused.
    assert!(host.order(KEEP_ALIVE, &[]));
    assert_eq!(host.ask(STATUS, &[2]), Nack(0));
    assert_eq!(host.data(STATUS, &[1]), [2, 0]);
    assert_eq!(host.data(STATUS, &[0]), [0, 0]);
    assert!(!host.order(KEEP_ALIVE, &[]));

    // Any message number, and the same for different commands.
    for number in [0, 0, 7, 7, 255] {
        assert_eq!(host.ask_as(number, KEEP_ALIVE, &[]), Ack(false));
        assert!(matches!(host.ask_as(number, ENCODER, &[1]), Data(_)));
    }
    // Broken packets, and those for others.
    let good = packet(HUB, 9, KEEP_ALIVE, &[]);
    let (mut bad_sum, mut too_short, mut too_long) = (good.clone(), good.clone(), good.clone());
    bad_sum[10] ^= 1;
    too_short[2] = 10;
    too_long[3] = 0xFF;
    for bad in
        [&bad_sum, &too_short, &too_long, &packet(7, 9, KEEP_ALIVE, &[]), &packet(255, 9, KEEP_ALIVE, &[])]
    {
        host.is_ignored(bad);
    }
    // A valid packet is found after each kind of invalid input: noise, a single or doubled start byte, a wrong
    // checksum, a wrong length followed by a pause, and an incomplete packet followed by a pause.
    let mut swallowed = good[..10].to_vec();
    swallowed[2] = 60;
    for (garbage, pause) in [
        (&[0x44, 0x00, 0x4B, 0xFF][..], 0),
        (&[0x44], 0),
        (&[0x44, 0x44], 0),
        (&bad_sum, 0),
        (&swallowed, 700),
        (&good[..7], 700),
    ] {
        host.send(garbage);
        sleep(Duration::from_millis(pause));
        host.number = 9;
        host.send(&good);
        let answered = host.reply().map(|(_, reply, _)| reply);
        assert_eq!(answered, Some(Ack(false)), "after {garbage:02x?}");
    }
    // Packets arrive in pieces, or several together.
    for byte in &good {
        host.send(&[*byte]);
        sleep(Duration::from_millis(1));
    }
    assert_eq!(host.reply().map(|reply| reply.1), Some(Ack(false)));
    host.send(&good.repeat(20));
    let numbers: Vec<u8> = (0..20).map(|_| host.reply().unwrap().2).collect();
    assert!(numbers.windows(2).all(|pair| pair[0] != pair[1]));
}

fn every_command_is_answered_and_bad_ones_change_nothing(host: &mut Host<impl Read + Write>) {
    assert!(matches!(host.ask(0x7F07, b"SERVO_HUB\0"), Nack(_)));
    let interface = host.data(0x7F07, b"DEKA\0");
    assert_eq!(interface[..2], DEKA.to_le_bytes());
    let known = u16::from_le_bytes([interface[2], interface[3]]);
    assert!(known >= 54);
    for function in 0..known {
        let _ = host.ask(DEKA + function, &[0; 34]);
    }
    assert!(matches!(host.ask(DEKA + known, &[]), Nack(255)));

    // Mode; channels of the converter.
    for (kind, payload, field) in [
        (8, &[4, 0, 0][..], 0),
        (8, &[0, 10, 0], 1),
        (10, &[0, 2], 1),
        (51, &[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1], 1),
        (7, &[15, 0], 0),
        (7, &[0, 2], 1),
    ] {
        assert_eq!(host.ask(DEKA + kind, payload), Nack(field), "{kind} {payload:02x?}");
    }
    assert_eq!(host.data(DEKA + 9, &[0]), [0, 0]);
    // Some programs send 2 instead of 1 for a motor that floats at zero power.
    host.order(DEKA + 8, &[0, 0, 2]);
    assert_eq!(host.data(DEKA + 9, &[0]), [0, 1]);
    host.order(DEKA + 8, &[0, 0, 0]);
    assert!(!matches!(host.ask(SET_POWER, &[0, 1]), Ack(_)), "cut short");
    assert_eq!(host.data(DEKA + 16, &[0]), [0, 0]);
    // Bytes after the last field of a request are ignored.
    let coefficients = [1_i32 << 16, -2, 3].map(i32::to_le_bytes).concat();
    host.order(DEKA + 23, &[&[1, 1], &coefficients[..], &[9; 5]].concat());
    let read = host.data(DEKA + 53, &[1, 1]);
    assert_eq!((&read[..12], read[16]), (&coefficients[..], 0), "legacy");
    assert_ne!(host.data(DEKA + 53, &[1, 2])[..12], coefficients, "of its own mode");
    assert_ne!(host.data(DEKA + 53, &[2, 1])[..12], coefficients, "of its own motor");
    assert_eq!(host.ask(DEKA + 21, &[0]), Nack(51), "at target without a position");

    // All requests for a device that the hub does not have are refused with this number.
    let refused = Nack(253);
    // Digital pins are inputs, and high while nothing is connected.
    let pins: Vec<u8> = (0..8).filter(|pin| host.ask(DEKA + 4, &[*pin]) != refused).collect();
    let all = pins.iter().fold(0, |all, pin| all | 1 << pin);
    assert!(pins.starts_with(&[0, 1]), "{pins:?}");
    assert_eq!((host.data(DEKA + 6, &[]), host.data(DEKA, &[])[0]), (vec![all], all));
    assert_eq!((host.ask(DEKA + 1, &[1, 0]), host.ask(DEKA + 2, &[0])), (Nack(11), Nack(18)));
    host.order(DEKA + 3, &[1, 1]);
    host.order(DEKA + 1, &[1, 1]);
    assert_eq!((host.ask(DEKA + 5, &[1]), host.data(DEKA + 6, &[])), (Nack(21), vec![all & 0xFD]));
    for pin in &pins {
        host.order(DEKA + 3, &[*pin, 1]);
    }
    assert_eq!(host.ask(DEKA + 6, &[]), Nack(28));
    for pin in &pins {
        host.order(DEKA + 3, &[*pin, 0]);
    }
    // A servo has no pulses before it has a width.
    for servo in 0..6 {
        if host.ask(DEKA + 32, &[servo]) == refused {
            assert_eq!(host.ask(DEKA + 33, &[servo, 0xDC, 5]), refused);
            continue;
        }
        assert_eq!(host.data(DEKA + 32, &[servo]), [0x20, 0x4E]);
        assert_eq!((host.ask(DEKA + 35, &[servo, 1]), host.data(DEKA + 36, &[servo])), (Nack(30), vec![0]));
        host.order(DEKA + 31, &[servo, 0x10, 0x27]);
        host.order(DEKA + 33, &[servo, 0xDC, 5]);
        host.order(DEKA + 35, &[servo, 1]);
        assert_eq!(host.data(DEKA + 36, &[servo]), [1]);
        host.order(DEKA + 35, &[servo, 0]);
    }
    // The speed of a bus is remembered. No device acknowledges address 0x10, and each transfer ends.
    for bus in 0..4 {
        if host.ask(DEKA + 47, &[bus]) == refused {
            assert_eq!(host.ask(DEKA + 39, &[bus, 0x10]), refused);
            continue;
        }
        host.order(DEKA + 43, &[bus, 1]);
        assert_eq!(host.data(DEKA + 47, &[bus]), [1]);
        host.order(DEKA + 39, &[bus, 0x10]);
        let result =
            wait_for("a result", || Some(host.ask(DEKA + 41, &[bus])).filter(|got| *got != Nack(41)));
        assert_eq!((result, host.ask(DEKA + 42, &[bus])), (Data(vec![1, 0]), Nack(43)));
    }
    // Every channel of the converter, in both of its units. Motors' and battery's values are always known.
    for (channel, raw) in (0..15).flat_map(|channel| [(channel, 0), (channel, 1)]) {
        match host.ask(DEKA + 7, &[channel, raw]) {
            Data(value) => assert_eq!(value.len(), 2, "{channel}"),
            reply => assert!(reply == refused && !(7..12).contains(&channel) && channel != 13, "{channel}"),
        }
    }
}

/// Motor 0 at half power.
pub(crate) fn drive(host: &mut Host<impl Read + Write>) {
    host.order(DEKA + 8, &[0, 0, 1]);
    host.order(SET_POWER, &[0, 0xFF, 0x3F]);
    host.order(SET_ENABLE, &[0, 1]);
}

fn silence_and_fail_safe_stop_the_motors(host: &mut Host<impl Read + Write>) {
    assert!(!host.enabled());
    // A motor without a target for its mode cannot be enabled. Setting a target does not enable a motor.
    host.order(DEKA + 8, &[3, 2, 0]);
    assert_eq!(host.ask(SET_ENABLE, &[3, 1]), Nack(50));
    host.order(SET_POWER, &[0, 0xFF, 0x3F]);
    host.order(DEKA + 17, &[0, 100, 0]);
    host.order(DEKA + 19, &[0, 100, 0, 0, 0, 5, 0]);
    assert!(!host.enabled());

    drive(host);
    // The current is read while the motor speeds up, because the current of a motor without a load at constant speed is
    // too small for the current-sense line.
    let draws = |host: &mut Host<_>| {
        sleep(Duration::from_millis(10));
        i16::from_le_bytes(host.data(DEKA + 7, &[8, 0]).try_into().unwrap())
    };
    let currents: Vec<i16> = (0..20).map(|_| draws(host)).collect();
    assert!(currents.iter().any(|&current| current > 0), "{currents:?} mA");
    let (from, began) = (host.counts(0), Instant::now());
    sleep(Duration::from_millis(2_100));
    assert!(host.enabled(), "2.1 s of silence are harmless");
    let (moved, took) = (host.counts(0) - from, began.elapsed().as_secs_f64());
    assert!(moved > 500, "positive power counts up: {moved} in {took} s");

    // Damaged packets and packets for other hubs do not reset the keep-alive timer.
    let mut damaged = packet(HUB, 1, KEEP_ALIVE, &[]);
    damaged[10] ^= 0x80;
    for _ in 0..3 {
        sleep(Duration::from_millis(900));
        host.send(&damaged);
        host.send(&packet(7, 1, KEEP_ALIVE, &[]));
    }
    assert!(host.order(KEEP_ALIVE, &[]), "attention");
    assert!(!host.enabled());
    assert_eq!(host.data(STATUS, &[1])[0] & 1, 1, "keep-alive timeout");
    host.order(SET_POWER, &[0, 0xFF, 0x3F]);
    assert!(!host.enabled(), "only enabling enables");
    host.order(SET_ENABLE, &[0, 1]);
    assert!(host.enabled(), "nothing is locked");

    host.order(0x7F05, &[]);
    assert!(!host.enabled());
    assert_eq!(host.data(STATUS, &[1])[0], 4, "fail-safe");
}

pub(crate) fn conforms(host: &mut Host<impl Read + Write>) {
    // The hub is found without its address.
    host.send(&packet(255, 0, 0x7F0F, &[]));
    assert_eq!(host.reply().map(|(kind, reply, _)| (kind, reply)), Some((0x7F0F, Data(vec![1]))));
    // No motor moves before a command.
    assert_eq!([0, 1, 2, 3].map(|motor| host.counts(motor)), [0; 4]);
    packets_are_found_and_answered(host);
    every_command_is_answered_and_bad_ones_change_nothing(host);
    silence_and_fail_safe_stop_the_motors(host);
}
