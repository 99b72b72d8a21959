//! A hub for tests of client, dashboard and command line: the firmware's responder, with a snapshot that the test sets.
#![allow(dead_code, reason = "each test uses its own part")]

use motor_hub::braking::Winding;
use motor_hub::extension::{HubFunction, INTERFACE};
use motor_hub::hub::{Command, Snapshot};
use motor_hub::motor::{Setpoint, Settings};
use motor_hub::protocol::requests::{FIRST_FUNCTION, MOTOR_INTERFACE};
use motor_hub::protocol::{Address, BROADCAST, Decoder, Packet, Reply, frame};
use motor_hub::responder::Responder;
use motor_hub::store::{self, Found, StoreRequest, Stored, VERSION};
use motor_hub::supply::DrawStage;
use motor_hub::units::{Micros, Millivolts};
use motor_hub::update::{Booted, Outcome, Slot, SlotReport, UpdateRequest};
use std::collections::VecDeque;
use std::fmt;
use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

pub(crate) const ADDRESS: u8 = 3;

pub(crate) type LosesReply = Box<dyn FnMut(&Packet) -> bool + Send>;

pub(crate) struct Hub {
    pub(crate) responder: Responder<4>,
    pub(crate) snapshot: Snapshot<4>,
    /// Set-points that the motors have received, with the number of the motor, oldest first.
    pub(crate) setpoints: Arc<Mutex<Vec<(usize, Setpoint)>>>,
    /// Motors that were enabled at least once.
    pub(crate) was_enabled: [bool; 4],
    /// Returns the bytes that are sent before a reply. The argument is the frame of the reply.
    pub(crate) before: fn(&[u8]) -> Vec<u8>,
    /// Time until a reply arrives on a line in memory.
    pub(crate) delay: Duration,
    /// Number of packets that the hub still loses. Each lost packet reduces this number by 1.
    pub(crate) deaf_for: u32,
    /// True for a request whose reply is lost on the line.
    pub(crate) loses_reply: LosesReply,
    /// False if accesses to the memory of stored settings never end.
    pub(crate) ends_accesses: bool,
    /// Packet type of the first motor function.
    pub(crate) first: u16,
    /// True if another host requests fail-safe before each bulk read.
    pub(crate) fail_safe_at_bulk: bool,
    /// Changes a request before the hub reads the request.
    pub(crate) change: fn(&mut Packet),
    /// Returns an answer to a request in place of the hub's answer; `None` if the hub answers.
    pub(crate) answer: fn(&Packet) -> Option<Reply>,
    /// True for a hub without this project's own interface.
    pub(crate) foreign: bool,
    /// How the hub starts after an update.
    pub(crate) restarts: Booted,
    /// Number of requests received.
    pub(crate) requests: Arc<AtomicU32>,
    pub(crate) decoder: Decoder,
    pub(crate) since: Instant,
}

impl Hub {
    /// Returns a hub just after its reset, with a battery of 12.345 V.
    pub(crate) fn new() -> Self {
        Self {
            responder: responder_at(ADDRESS),
            snapshot: Snapshot {
                battery: Some(Millivolts::new(12_345)),
                draw_stage: DrawStage::Full,
                ..Snapshot::INITIAL
            },
            setpoints: Arc::default(),
            was_enabled: [false; 4],
            before: |_| Vec::new(),
            delay: Duration::ZERO,
            deaf_for: 0,
            loses_reply: Box::new(|_| false),
            ends_accesses: true,
            first: FIRST_FUNCTION,
            fail_safe_at_bulk: false,
            change: |_| (),
            answer: |_| None,
            foreign: false,
            restarts: Booted::Confirmed,
            requests: Arc::default(),
            decoder: Decoder::new(),
            since: Instant::now(),
        }
    }

    /// Returns a hub whose clock shows this time since its reset, in ms.
    pub(crate) fn running_for(ms: u64) -> Self {
        let mut hub = Self::new();
        hub.snapshot.at = Micros::new(1_000 * ms);
        hub
    }

    /// Lets the line lose the replies to these requests. Returns a flag that the first of them sets.
    pub(crate) fn lose_replies(&mut self, to: impl Fn(&Packet) -> bool + Send + 'static) -> Arc<AtomicBool> {
        let lost = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&lost);
        self.loses_reply = Box::new(move |packet| {
            let loses = to(packet);
            seen.fetch_or(loses, Ordering::Relaxed);
            loses
        });
        lost
    }

    /// Executes the requests in the bytes of a host, and returns the bytes of all replies.
    fn exchange(&mut self, mut bytes: &[u8]) -> Vec<u8> {
        let now = Micros::new(self.since.elapsed().as_micros() as u64);
        let mut out = Vec::new();
        while let Some(mut packet) = self.decoder.next(&mut bytes, now) {
            if self.deaf_for > 0 {
                self.deaf_for -= 1;
                continue;
            }
            self.requests.fetch_add(1, Ordering::Relaxed);
            if self.foreign && packet.payload.starts_with(INTERFACE) {
                packet.payload[0] = b'?';
            }
            (self.change)(&mut packet);
            let is_bulk = packet.id == self.first;
            if packet.id < 0x7F00 {
                packet.id =
                    packet.id.checked_sub(self.first - FIRST_FUNCTION).expect("a function of this hub");
            }
            if is_bulk && self.fail_safe_at_bulk {
                let mut other = packet.clone();
                other.id = 0x7F05;
                self.responder.receive(&other, now, &self.snapshot);
            }
            let address = self.responder.address().get();
            let is_for_this_hub = [address, BROADCAST].contains(&packet.destination);
            let answer = (self.answer)(&packet).filter(|_| is_for_this_hub);
            let answer = answer.map(|answer| answer.packet(&packet, address, 1));
            let reply = answer.or_else(|| self.responder.receive(&packet, now, &self.snapshot));
            let Some(mut reply) = reply else { continue };
            if packet.id == 0x7F07 && packet.payload.starts_with(MOTOR_INTERFACE) {
                reply.payload[..2].copy_from_slice(&self.first.to_le_bytes());
            } else if reply.id & 0x8000 != 0 && reply.id < 0xFF00 {
                reply.id += self.first - FIRST_FUNCTION;
            }
            if let Some(request) = self.responder.update_request() {
                self.update(request);
            }
            // An access to the memory lasts until the host asks for the state of the stored settings.
            if self.ends_accesses
                && packet.id == HubFunction::Stored.id()
                && let Some(StoreRequest { record, .. }) = self.responder.store_request(&self.snapshot)
            {
                // A load has no record to write, and leaves the contents of the memory unchanged.
                let found = record.map(|record| Found { stored: Stored::Whole, version: VERSION, record });
                self.responder.store_done(found, store::Outcome::Done);
            }
            while let Some(command) = self.responder.pending() {
                if let Command::Set { motor, setpoint } = command {
                    self.setpoints.lock().unwrap().push((motor, setpoint));
                }
                self.snapshot.newest_command += 1;
                self.responder.sent(self.snapshot.newest_command);
            }
            let now_enabled = self.responder.enabled();
            self.was_enabled.iter_mut().zip(now_enabled).for_each(|(was, is)| *was |= is);
            if (self.loses_reply)(&packet) {
                continue;
            }
            let frame = frame::encode(&reply);
            out.extend((self.before)(&frame));
            out.extend(&frame);
        }
        out
    }

    /// Executes a request to the slot for new firmware. The fake flash accepts an image without a signature or with
    /// [`SIGNATURE`].
    fn update(&mut self, request: UpdateRequest) {
        let signature = match request {
            UpdateRequest::Restart => return self.responder = started(SLOT, self.restarts),
            UpdateRequest::Arm { signature, .. } => signature.map(|signature| signature.bytes),
            _ => None,
        };
        let outcome = match signature {
            Some(SIGNATURE_OF_OLDER) => Outcome::Older,
            Some(SIGNATURE) | None => Outcome::Done,
            Some(_) => Outcome::WrongSignature,
        };
        self.responder.update_done(SlotReport::Result(outcome));
    }
}

/// Returns a value for [`Hub::loses_reply`] that loses the first `count` replies to requests for which `is` is true.
pub(crate) fn first(mut count: u32, is: impl Fn(&Packet) -> bool + Send + 'static) -> LosesReply {
    Box::new(move |packet| {
        let loses = count > 0 && is(packet);
        count -= u32::from(loses);
        loses
    })
}

/// State of a hub with this address just after its reset.
pub(crate) fn responder_at(address: u8) -> Responder<4> {
    Responder::new(Address::new(address).unwrap(), [Settings::new(Winding::NEVEREST_60); 4])
}

/// A slot for new firmware.
pub(crate) const SLOT: Slot =
    Slot { origin: 0x0802_0000, length: 512 * 1024, ram: (0x2000_0000, 0x2002_0000), signer: None };

/// Bytes that the fake flash accepts as the owner's signature of any image.
pub(crate) const SIGNATURE: [u8; 64] = [7; 64];

/// The signature of an image that is older than the hub's firmware.
pub(crate) const SIGNATURE_OF_OLDER: [u8; 64] = [6; 64];

/// Returns the responder of a hub with this slot for new firmware. `booted` says how the firmware was started.
pub(crate) fn started(slot: Slot, booted: Booted) -> Responder<4> {
    let mut responder = responder_at(ADDRESS).with_slot(slot);
    responder.update_done(SlotReport::Booted(booted));
    responder
}

/// A line in memory with hubs at its other end.
pub(crate) struct Memory {
    hubs: Vec<Hub>,
    /// Replies with the times at which they arrive.
    replies: Vec<(Instant, Vec<u8>)>,
    arrived: VecDeque<u8>,
    /// Number of reads without a byte. Each of these reads waits 200 µs.
    pub(crate) empty_reads: Arc<AtomicU32>,
}

impl Memory {
    pub(crate) fn new(hub: Hub) -> Self {
        Self::of(vec![hub])
    }

    pub(crate) fn of(hubs: Vec<Hub>) -> Self {
        Self { hubs, replies: Vec::new(), arrived: VecDeque::new(), empty_reads: Arc::default() }
    }
}

impl fmt::Debug for Memory {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("hubs in memory")
    }
}

impl Read for Memory {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let now = Instant::now();
        for (_, reply) in self.replies.extract_if(.., |(at, _)| *at <= now) {
            self.arrived.extend(reply);
        }
        if self.arrived.is_empty() {
            self.empty_reads.fetch_add(1, Ordering::Relaxed);
            std::thread::sleep(Duration::from_micros(200));
            return Err(ErrorKind::WouldBlock.into());
        }
        self.arrived.read(buffer)
    }
}

impl Write for Memory {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.replies
            .extend(self.hubs.iter_mut().map(|hub| (Instant::now() + hub.delay, hub.exchange(bytes))));
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

/// A hub that listens for one host after the other until the test ends.
pub(crate) struct Server {
    pub(crate) address: String,
    hub: Arc<Mutex<Hub>>,
}

impl Server {
    pub(crate) fn start(hub: Hub) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let hub = Arc::new(Mutex::new(hub));
        let shared = Arc::clone(&hub);
        std::thread::spawn(move || {
            for stream in listener.incoming() {
                // An error means that the host has closed the connection.
                let _ = serve(stream.unwrap(), &shared);
            }
        });
        Self { address, hub }
    }

    pub(crate) fn hub(&self) -> MutexGuard<'_, Hub> {
        self.hub.lock().unwrap()
    }
}

fn serve(mut stream: TcpStream, hub: &Mutex<Hub>) -> std::io::Result<()> {
    stream.set_nodelay(true)?;
    let mut bytes = [0; 256];
    loop {
        let count = stream.read(&mut bytes)?;
        if count == 0 {
            return Ok(());
        }
        let replies = hub.lock().unwrap().exchange(&bytes[..count]);
        stream.write_all(&replies)?;
    }
}
