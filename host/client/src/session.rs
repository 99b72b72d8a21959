//! Sends one request at a time over a line, waits for the answer, retransmits, and discovers hubs.

#[cfg(feature = "serial")]
use crate::OpenError;
use crate::clock::Instant;
use crate::{Error, Line};
use motor_hub::chain::ChainReport;
use motor_hub::extension::Request;
use motor_hub::protocol::answers::Functions;
use motor_hub::protocol::payload::{Field, Fields};
use motor_hub::protocol::pins::ToPin;
use motor_hub::protocol::requests::{DISCOVERY, FAIL_SAFE, InterfaceName, Standard};
use motor_hub::protocol::{Address, BROADCAST, Decoder, HOST, Nack, Packet, Reply, frame};
use motor_hub::units::Micros;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::io::ErrorKind;
use std::thread;
use std::time::Duration;

/// Number of transmissions of a request before the hub counts as silent. A write to an I2C device is sent once, because
/// a device may act on each write.
///
/// A hub may have executed a request whose answer was lost. The hub then executes the request a second time. In most
/// cases the second execution has no effect, because no request changes a value by an amount. There are two exceptions:
/// a second *reset encoder* of a turning motor sets the zero to the later position, and a second I2C read reads the
/// device again.
///
/// The second answer may differ. For example, the first execution has cleared the status word already, or a save is
/// running already.
pub const TRANSMISSIONS: u32 = 3;

/// Longest time-out of a session, far beyond the time that any hub needs for an answer. The clock of the system cannot
/// add some longer times to the present time.
pub const MAX_TIMEOUT: Duration = Duration::from_secs(3600);

/// Longest time from the first answer to a discovery until the last answer. The parent of a chain waits 2 ms for each
/// of 254 addresses, which takes 508 ms. Sending the 254 requests of 11 bytes at 460800 baud takes 61 ms more.
pub const CHAIN_DISCOVERY_TIMEOUT: Duration = Duration::from_millis(650);

/// Longest time from the first answer to a discovery until the answer of another parent. Several hubs on one line that
/// are not a chain all answer as parent.
const SECOND_PARENT_DELAY: Duration = Duration::from_millis(50);

/// Interval between two requests to a hub that is discovering the hubs behind it.
const CHAIN_POLL_INTERVAL: Duration = Duration::from_millis(20);

/// Longest time for which bytes of earlier exchanges (stale input) are read and dropped before a request is sent. A
/// line that is never silent must not block a request.
const STALE_INPUT_LIMIT: Duration = Duration::from_millis(50);

/// A hub that answered a discovery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found {
    /// Address of the hub, 1 to 254.
    pub address: u8,
    /// True if the hub is on this line, false if it is behind another hub.
    pub parent: bool,
    /// True if the parent reports several hubs with this address, so that none of these hubs can be used. A parent
    /// that is not a hub of this project reports no such address, so the value is false.
    pub duplicate: bool,
}

/// Advance of a hub's clock beyond the clock of this machine between two reports, above which the hub counts as reset: a
/// day. A reset hub starts its clock again at 0. Modulo 2^32 ms (49.7 days) this is a large advance, except in the last
/// day before the clock wraps. A computer that is suspended for less than a day does not reach this limit.
const RESET_ADVANCE: Duration = Duration::from_secs(24 * 60 * 60);

/// The clock of a hub at its newest report.
#[derive(Clone, Copy, Debug)]
struct HubClock {
    /// Time of this machine before the request for the report.
    asked: Instant,
    /// Time of the hub in the report, in ms since its start, modulo 2^32.
    at_ms: u32,
    /// Number of resets that the reports have shown.
    resets: u32,
}

/// A host's session with one hub. Every method that sends requests also fails with the errors of
/// [`request`](Self::request).
#[derive(Debug)]
pub struct Session {
    line: Line,
    decoder: Decoder,
    /// Received packets that have not been read yet.
    arrived: VecDeque<Packet>,
    /// True if the first transmission of the last request was answered and no other packet had arrived. The next
    /// request is then sent without a wait for stale input, because the wait takes several times as long as an
    /// exchange. A late answer of another hub is ignored, because the answer refers to another message number.
    no_stale_input: bool,
    since: Instant,
    pub(crate) timeout: Duration,
    /// Message number of the last request.
    number: u8,
    pub(crate) address: u8,
    /// Packet types that hubs have reported, by address and interface. Each hub may number its functions differently.
    functions: BTreeMap<(u8, &'static [u8]), Functions>,
    /// Clocks of hubs that have reported their state, by address.
    clocks: BTreeMap<u8, HubClock>,
    /// Addresses of hubs that have refused [`Session::report`], so that later calls need not ask again.
    pub(crate) reporting_nothing: BTreeSet<u8>,
}

impl Session {
    /// Opens a session with the hub at `place`: `HOST:PORT`, or else a serial port. The time-out is 1 s.
    ///
    /// # Errors
    /// The line cannot be opened, or not exactly one hub answers as parent.
    ///
    /// ```no_run
    /// use motor_hub_client::Session;
    ///
    /// let mut hub = Session::open("/dev/ttyACM0")?;
    /// println!("battery: {} mV", hub.battery()?.get());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[cfg(feature = "serial")]
    pub fn open(place: &str) -> Result<Self, OpenError> {
        let timeout = Duration::from_secs(1);
        Ok(Self::with_parent(Line::open(place, timeout)?, timeout)?)
    }

    /// Makes a session with the hub at `address`. A request without an answer is sent [`TRANSMISSIONS`] times within
    /// `timeout`, which is limited to [`MAX_TIMEOUT`].
    pub fn new(line: impl Into<Line>, address: Address, timeout: Duration) -> Self {
        Self {
            line: line.into(),
            decoder: Decoder::new(),
            arrived: VecDeque::new(),
            no_stale_input: false,
            since: Instant::now(),
            timeout: timeout.min(MAX_TIMEOUT),
            number: 0,
            address: address.get(),
            functions: BTreeMap::new(),
            clocks: BTreeMap::new(),
            reporting_nothing: BTreeSet::new(),
        }
    }

    /// Makes a session with the hub that answers a discovery as parent. The time-out of requests is `timeout`, but at
    /// most [`MAX_TIMEOUT`].
    ///
    /// # Errors
    /// Not exactly one hub answers as parent.
    pub fn with_parent(line: impl Into<Line>, timeout: Duration) -> Result<Self, Error> {
        let mut session = Self::new(line, Address::DEFAULT, timeout);
        session.find_parent()?;
        Ok(session)
    }

    /// Discovers all hubs on the line. Later requests go to the hub that answers as parent.
    ///
    /// # Errors
    /// Not exactly one hub answers as parent.
    pub fn find_parent(&mut self) -> Result<Vec<Found>, Error> {
        let found = self.discover()?;
        let parents: Vec<u8> = found.iter().filter(|hub| hub.parent).map(|hub| hub.address).collect();
        let [parent] = parents.as_slice() else {
            let addresses = found.iter().map(|hub| hub.address).collect();
            return Err(Error::Parents { found: parents.len(), addresses });
        };
        self.address = *parent;
        Ok(found)
    }

    /// The hub's address.
    pub const fn address(&self) -> u8 {
        self.address
    }

    /// Limits the time-out of later requests to `timeout`.
    pub fn limit_timeout(&mut self, timeout: Duration) {
        self.timeout = self.timeout.min(timeout);
    }

    /// Sets the time-out of later requests, which is limited to [`MAX_TIMEOUT`].
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout.min(MAX_TIMEOUT);
    }

    /// Sends later requests to the hub at `address` on the same line.
    pub fn select_hub(&mut self, address: Address) {
        self.address = address.get();
    }

    /// Number of resets of the selected hub that the reports of this session have shown. A reset is shown by the first
    /// [`report`](Self::report) after the reset, unless the hub had then run at least as long as at the report before the
    /// reset. After a reset the session asks the hub again for its functions, because the hub may have new firmware.
    pub fn resets(&self) -> u32 {
        self.clocks.get(&self.address).map_or(0, |clock| clock.resets)
    }

    /// Records the clock in a report of the selected hub. `asked` is the time before the request for the report.
    pub(crate) fn note_clock(&mut self, asked: Instant, at_ms: u32) {
        let before = self.clocks.get(&self.address).copied();
        let is_reset = before.is_some_and(|before| {
            let advance = Duration::from_millis(at_ms.wrapping_sub(before.at_ms).into());
            advance > before.asked.elapsed() + RESET_ADVANCE
        });
        if is_reset {
            self.forget(self.address);
        }
        let resets = before.map_or(0, |before| before.resets) + u32::from(is_reset);
        self.clocks.insert(self.address, HubClock { asked, at_ms, resets });
    }

    /// Deletes what the hub at `address` has reported of itself, because another hub may have this address now.
    pub(crate) fn forget(&mut self, address: u8) {
        self.functions.retain(|(of, _), _| *of != address);
        self.reporting_nothing.remove(&address);
    }

    /// Discovers all hubs on the line. A parent of this project reports the hubs behind it. These hubs follow the
    /// parent in the order of their addresses. With another parent, or if not exactly one hub answers as parent, the
    /// function sends a second discovery and waits for answers, until [`CHAIN_DISCOVERY_TIMEOUT`] or the time-out has
    /// passed. The hubs are then in the order of their answers.
    ///
    /// # Errors
    /// [`Error::NoHub`] if no hub answers within the time-out.
    pub fn discover(&mut self) -> Result<Vec<Found>, Error> {
        let (parents, early): (Vec<_>, Vec<_>) =
            self.discover_for(SECOND_PARENT_DELAY)?.into_iter().partition(|hub| hub.parent);
        let [parent] = parents[..] else {
            return self.discover_for(CHAIN_DISCOVERY_TIMEOUT);
        };
        match self.wait_for_chain(parent.address)? {
            Some(ChainReport { answering, duplicate, .. }) => {
                let has_answered = |address| early.iter().any(|child| child.address == address);
                let children = (1..BROADCAST).filter(|&address| {
                    answering.has(address) || duplicate.has(address) || has_answered(address)
                });
                let children = children.map(|address| Found {
                    address,
                    parent: false,
                    duplicate: duplicate.has(address),
                });
                Ok(std::iter::once(parent).chain(children).collect())
            }
            None => self.discover_for(CHAIN_DISCOVERY_TIMEOUT),
        }
    }

    /// Disables the motors of all hubs on the line, and returns the hubs. Hubs of this project disable their motors
    /// within milliseconds, because a broadcast precedes the discovery.
    ///
    /// # Errors
    /// [`Error::NoHub`] if no hub answers. [`Error::Silent`] for the first hub that does not confirm, after all others
    /// were stopped.
    pub fn stop_all(&mut self) -> Result<Vec<u8>, Error> {
        self.stop_hubs(&[])?;
        let found: Vec<u8> =
            self.discover()?.iter().filter(|hub| !hub.duplicate).map(|hub| hub.address).collect();
        self.confirm_stop(&found).map(|()| found)
    }

    /// Disables the motors of all hubs on the line, and waits until the hubs at the `known` addresses have confirmed.
    /// This is faster than [`stop_all`](Self::stop_all), which discovers the hubs.
    ///
    /// # Errors
    /// [`Error::Silent`] for the first known hub that does not confirm, after all others were stopped.
    pub fn stop_hubs(&mut self, known: &[u8]) -> Result<(), Error> {
        self.next_message_number();
        self.transmit(&Standard::FailSafe.into(), BROADCAST, FAIL_SAFE)?;
        self.confirm_stop(known)
    }

    /// Sends *fail-safe* to each of these hubs, and waits for its confirmation. All hubs get the request; the result is
    /// the first error.
    fn confirm_stop(&mut self, hubs: &[u8]) -> Result<(), Error> {
        let before = self.address;
        let stopped = hubs.iter().map(|&address| {
            self.address = address;
            self.fail_safe()
        });
        let all = stopped.fold(Ok(()), Result::and);
        self.address = before;
        all
    }

    /// Sends a discovery up to [`TRANSMISSIONS`] times until a hub answers, and returns the hubs that answer within the
    /// time-out. The wait ends `chain` after the first answer.
    fn discover_for(&mut self, chain: Duration) -> Result<Vec<Found>, Error> {
        let end = Instant::now() + self.timeout;
        self.next_message_number();
        let mut found: Vec<Found> = Vec::new();
        let parent = |packet: &Packet| match Reply::read(packet, DISCOVERY) {
            Some(Reply::Data(payload)) => Some(bool::read(&mut Fields::new(&payload)) == Ok(true)),
            _ => None,
        };
        for _ in 0..TRANSMISSIONS {
            let mut wait_until = Instant::now() + self.timeout / TRANSMISSIONS;
            self.transmit(&Standard::Discovery.into(), BROADCAST, DISCOVERY)?;
            while let Some((packet, parent)) = self.next(wait_until, parent)? {
                if found.is_empty() {
                    wait_until = end.min(Instant::now() + chain);
                }
                if found.iter().all(|hub| hub.address != packet.source) {
                    found.push(Found { address: packet.source, parent, duplicate: false });
                }
            }
            if !found.is_empty() {
                return Ok(found);
            }
        }
        Err(Error::NoHub)
    }

    /// Waits until the hub at `parent` has discovered the hubs behind it, for [`CHAIN_DISCOVERY_TIMEOUT`] at most, and
    /// returns its report. After this time the report may be incomplete. The report is empty if the hub has no chain
    /// line. Returns `None` for a hub of another maker, or with older firmware.
    fn wait_for_chain(&mut self, parent: u8) -> Result<Option<ChainReport>, Error> {
        let before = std::mem::replace(&mut self.address, parent);
        let end = Instant::now() + CHAIN_DISCOVERY_TIMEOUT;
        let report = loop {
            match self.chain() {
                Ok(Some(report)) if report.discovering && Instant::now() < end => {
                    thread::sleep(CHAIN_POLL_INTERVAL)
                }
                Ok(report) => break Ok(report),
                Err(Error::Refused { reason: Nack::UNSUPPORTED, .. }) => {
                    break Ok(Some(ChainReport::default()));
                }
                Err(error) => break Err(error),
            }
        };
        self.address = before;
        report
    }

    /// Sends a request and reads its answer, whose type [`requests`](motor_hub::protocol::requests) defines.
    ///
    /// # Errors
    /// The line fails or is closed. The hub does not answer, refuses the request, or lacks the function. The answer has
    /// another type.
    pub fn request<A: Field>(&mut self, request: impl Into<Request>) -> Result<A, Error> {
        self.request_with(request, |payload| A::read(&mut Fields::new(payload)))
    }

    /// Sends a request and converts the payload of its answer by `read`.
    pub(crate) fn request_with<A>(
        &mut self,
        request: impl Into<Request>,
        read: impl FnOnce(&[u8]) -> Result<A, Nack>,
    ) -> Result<A, Error> {
        let request = request.into();
        if let Reply::Data(payload) = self.exchange(&request)?
            && let Ok(answer) = read(&payload)
        {
            return Ok(answer);
        }
        Err(Error::Unexpected { request: Box::new(request) })
    }

    /// Sends a request whose answer is an acknowledgement.
    ///
    /// # Errors
    /// The errors of [`request`](Self::request).
    pub fn command(&mut self, request: impl Into<Request>) -> Result<(), Error> {
        let request = request.into();
        match self.exchange(&request)? {
            Reply::Ack { .. } => Ok(()),
            _ => Err(Error::Unexpected { request: Box::new(request) }),
        }
    }

    /// Sends a request up to [`TRANSMISSIONS`] times until the hub answers. A refusal is an error. A write to an I2C
    /// device is sent once.
    fn exchange(&mut self, request: &Request) -> Result<Reply, Error> {
        let (id, address) = (self.id(request)?, self.address);
        // The retransmitted packet is unchanged, so an answer to the first transmission is accepted if the answer
        // arrives after the second transmission.
        self.next_message_number();
        let is_i2c_write =
            matches!(request, Request::ToPin(ToPin::WriteI2c { .. } | ToPin::WriteI2cByte { .. }));
        let transmissions = if is_i2c_write { 1 } else { TRANSMISSIONS };
        for tried in 0..transmissions {
            let end = Instant::now() + self.timeout / transmissions;
            self.transmit(request, address, id)?;
            let answer = |packet: &Packet| Reply::read(packet, id).filter(|_| packet.source == address);
            let Some((_, reply)) = self.next(end, answer)? else { continue };
            self.no_stale_input = tried == 0 && self.arrived.is_empty();
            return match reply {
                Reply::Nack(reason) => Err(Error::Refused { request: Box::new(request.clone()), reason }),
                reply => Ok(reply),
            };
        }
        Err(if is_i2c_write {
            Error::Unconfirmed { address, request: Box::new(request.clone()) }
        } else {
            Error::Silent { address }
        })
    }

    /// Returns the packet type of a request. Each hub chooses the numbers of its functions, so the session asks each
    /// hub once for these numbers.
    fn id(&mut self, request: &Request) -> Result<u16, Error> {
        let Some(interface) = request.interface() else { return Ok(request.id()) };
        let key = (self.address, interface);
        let functions = match self.functions.get(&key) {
            Some(functions) => *functions,
            None => {
                let name = InterfaceName::from_slice(interface).expect("a short name");
                let functions = self.request(Standard::QueryInterface { name })?;
                self.functions.insert(key, functions);
                functions
            }
        };
        functions.id(request.number()).ok_or_else(|| Error::TooOld { request: Box::new(request.clone()) })
    }

    fn next_message_number(&mut self) {
        self.number = self.number.checked_add(1).unwrap_or(1);
    }

    fn transmit(&mut self, request: &Request, destination: u8, id: u16) -> Result<(), Error> {
        self.drop_stale_input()?;
        let frame = frame::encode(&request.packet(destination, self.number, id));
        Ok(self.line.0.write_all(&frame)?)
    }

    fn drop_stale_input(&mut self) -> Result<(), Error> {
        let end = Instant::now() + STALE_INPUT_LIMIT;
        let mut bytes = [0; 256];
        while !self.no_stale_input && Instant::now() < end && self.receive(&mut bytes)? > 0 {}
        self.no_stale_input = false;
        self.decoder = Decoder::new();
        self.arrived.clear();
        Ok(())
    }

    /// Returns the next packet to this host that refers to the last request and that `read` accepts. `None` if no such
    /// packet arrives before `end`.
    fn next<T>(
        &mut self,
        end: Instant,
        read: impl Fn(&Packet) -> Option<T>,
    ) -> Result<Option<(Packet, T)>, Error> {
        let mut bytes = [0; 256];
        loop {
            while let Some(packet) = self.arrived.pop_front() {
                let ours = packet.destination == HOST && packet.reference == self.number;
                if let Some(read) = read(&packet).filter(|_| ours) {
                    return Ok(Some((packet, read)));
                }
            }
            if Instant::now() >= end {
                return Ok(None);
            }
            let count = self.receive(&mut bytes)?;
            let now = Micros::new(u64::try_from(self.since.elapsed().as_micros()).unwrap_or(u64::MAX));
            let mut input = bytes.get(..count).unwrap_or_default();
            while let Some(packet) = self.decoder.next(&mut input, now) {
                self.arrived.push_back(packet);
            }
        }
    }

    /// Reads bytes within [`POLL`](crate::line::POLL), and returns their number; 0 if no byte has arrived.
    fn receive(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        match self.line.0.read(bytes) {
            Ok(0) => Err(Error::HungUp),
            Ok(count) => Ok(count),
            Err(e)
                if matches!(
                    e.kind(),
                    ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted
                ) =>
            {
                Ok(0)
            }
            Err(e) => Err(e.into()),
        }
    }
}
