//! One request at a time over a line: waiting for its answer, trying again, finding hubs.

use super::Error;
use super::wire::{self, Answer, RESPONSE};
use motor_hub::link::command::DISCOVERY;
use motor_hub::link::{Address, BROADCAST, Decoder, HOST, Packet};
use motor_hub::units::Micros;
use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

/// How often a request is sent before the hub counts as silent. A hub may have executed one whose
/// answer was lost; none of the requests here does more when it is executed again.
pub const TRIES: u32 = 3;

/// How long further hubs have to answer a discovery after the first one.
pub const CHAIN: Duration = Duration::from_millis(250);

/// The longest that stale input is read away: a line that is never silent must not stop a request.
const STALE: Duration = Duration::from_millis(50);

/// A hub that answered a discovery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Found {
    /// 1 to 254.
    pub address: u8,
    /// True if it is on this line, false if it is behind another hub.
    pub parent: bool,
}

/// A host's talk with one hub. Reads of the line must not block for long: see [`super::line::POLL`].
#[derive(Debug)]
pub struct Session<L> {
    line: L,
    decoder: Decoder,
    /// Packets that came together with others and have not been looked at.
    arrived: VecDeque<Packet>,
    since: Instant,
    timeout: Duration,
    /// Of the last request.
    number: u8,
    pub(super) address: u8,
    /// First type and number of functions of the motor interface, once asked.
    pub(super) interface: Option<(u16, u16)>,
}

impl<L: Read + Write> Session<L> {
    /// With the hub at `address`. An answer is waited for as long as `timeout`, in which the request is
    /// sent [`TRIES`] times.
    pub fn new(line: L, address: Address, timeout: Duration) -> Self {
        Self {
            line,
            decoder: Decoder::new(),
            arrived: VecDeque::new(),
            since: Instant::now(),
            timeout,
            number: 0,
            address: address.get(),
            interface: None,
        }
    }

    /// With the hub that answers a discovery as parent.
    ///
    /// # Errors
    /// None does, or more than one.
    pub fn with_parent(line: L, timeout: Duration) -> Result<Self, Error> {
        let mut session = Self::new(line, Address::DEFAULT, timeout);
        let found = session.discover()?;
        let parents: Vec<u8> = found.iter().filter(|hub| hub.parent).map(|hub| hub.address).collect();
        let [parent] = parents.as_slice() else {
            let addresses: Vec<String> = found.iter().map(|hub| hub.address.to_string()).collect();
            return Err(Error::Parents { found: parents.len(), addresses: addresses.join(", ") });
        };
        session.address = *parent;
        Ok(session)
    }

    /// The hub's address.
    pub const fn address(&self) -> u8 {
        self.address
    }

    /// Every hub on the line, in the order of their answers.
    ///
    /// # Errors
    /// [`Error::NoHub`] if none answers within the timeout.
    pub fn discover(&mut self) -> Result<Vec<Found>, Error> {
        let end = Instant::now() + self.timeout;
        self.count();
        self.transmit(BROADCAST, DISCOVERY, &[])?;
        let mut found: Vec<Found> = Vec::new();
        let mut wait_until = end;
        let response = DISCOVERY | RESPONSE;
        while let Some(packet) = self.next(wait_until, |packet| packet.id == response)? {
            if found.is_empty() {
                wait_until = end.min(Instant::now() + CHAIN);
            }
            if found.iter().all(|hub| hub.address != packet.source) {
                found.push(Found { address: packet.source, parent: packet.payload.first() == Some(&1) });
            }
        }
        if found.is_empty() { Err(Error::NoHub) } else { Ok(found) }
    }

    /// Sends a request of type `id` until it is answered. `what` completes "the hub was asked to".
    ///
    /// # Errors
    /// The line is broken, or the hub silent, or it refuses.
    pub fn ask(&mut self, what: &str, id: u16, payload: &[u8]) -> Result<Answer, Error> {
        let address = self.address;
        // Retransmitted unchanged, so a late answer to the first try counts.
        self.count();
        for _ in 0..TRIES {
            let end = Instant::now() + self.timeout / TRIES;
            self.transmit(address, id, payload)?;
            let is_answer = |packet: &Packet| packet.source == address && Answer::read(packet, id).is_some();
            if let Some(answer) = self.next(end, is_answer)?.and_then(|packet| Answer::read(&packet, id)) {
                return match answer {
                    Answer::Nack(reason) => Err(Error::Refused { what: what.to_owned(), reason }),
                    answer => Ok(answer),
                };
            }
        }
        Err(Error::Silent { address })
    }

    /// A request that is answered with data.
    ///
    /// # Errors
    /// As [`ask`](Self::ask), or it is acknowledged instead.
    pub fn read(&mut self, what: &str, id: u16, payload: &[u8]) -> Result<Vec<u8>, Error> {
        match self.ask(what, id, payload)? {
            Answer::Data(data) => Ok(data),
            _ => Err(Error::Unexpected { what: what.to_owned() }),
        }
    }

    /// A request that is acknowledged. True if the module status has something to say.
    ///
    /// # Errors
    /// As [`ask`](Self::ask), or it is answered with data instead.
    pub fn write(&mut self, what: &str, id: u16, payload: &[u8]) -> Result<bool, Error> {
        match self.ask(what, id, payload)? {
            Answer::Ack { attention } => Ok(attention),
            _ => Err(Error::Unexpected { what: what.to_owned() }),
        }
    }

    fn count(&mut self) {
        self.number = self.number.checked_add(1).unwrap_or(1);
    }

    fn transmit(&mut self, destination: u8, id: u16, payload: &[u8]) -> Result<(), Error> {
        self.drop_stale_input()?;
        Ok(self.line.write_all(&wire::request(destination, self.number, id, payload))?)
    }

    fn drop_stale_input(&mut self) -> Result<(), Error> {
        let end = Instant::now() + STALE;
        let mut bytes = [0; 256];
        while Instant::now() < end && self.receive(&mut bytes)? > 0 {}
        self.decoder = Decoder::new();
        self.arrived.clear();
        Ok(())
    }

    /// The next packet to this host that refers to the last request and is `wanted`; `None` if there is
    /// none until `end`.
    fn next(&mut self, end: Instant, wanted: impl Fn(&Packet) -> bool) -> Result<Option<Packet>, Error> {
        let mut bytes = [0; 256];
        loop {
            while let Some(packet) = self.arrived.pop_front() {
                if packet.destination == HOST && packet.reference == self.number && wanted(&packet) {
                    return Ok(Some(packet));
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

    /// Bytes that are there, or come soon.
    fn receive(&mut self, bytes: &mut [u8]) -> Result<usize, Error> {
        match self.line.read(bytes) {
            Ok(0) => Err(std::io::Error::new(ErrorKind::UnexpectedEof, "the hub has hung up").into()),
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
