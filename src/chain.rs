//! A chain of hubs: one *parent*, to which the host is connected, and *children* behind it. Parent and children share a
//! half-duplex line (RS-485), the *chain line*.
//!
//! ```text
//! host ---- parent ====+=========+==== chain line
//!                      |         |
//!                    child     child
//! ```
//!
//! A *discovery* is the host's request to all hubs to state their addresses. The hub that receives it from the host is
//! the parent. A child sends on the chain line only to answer the parent. The parent
//! * passes on the host's requests to other addresses, and the answers to them, unchanged;
//! * asks each address after a discovery whether it has a hub, and waits [`SLOT_MICROS`] for each answer;
//! * waits at most [`ANSWER_MICROS`] for the answer to another request. If no answer comes, the host gets no answer;
//! * passes on a *stop to all*, a fail-safe to the address 255, in place of all waiting requests. No child answers a
//!   stop to all.
//!
//! The parent's own answers do not pass through the chain line, so no child can delay them. Each hub has its own
//! keep-alive timer, which only packets to that hub restart.
//!
//! ```
//! use motor_hub::chain::{ANSWER_MICROS, Chain};
//! use motor_hub::protocol::Packet;
//! use motor_hub::units::Micros;
//!
//! let mut chain = Chain::default();
//! let keep_alive = Packet { destination: 5, number: 1, id: 0x7F04, ..Packet::default() };
//! chain.request(keep_alive.clone());
//! let now = Micros::new(0);
//! assert_eq!(chain.next(now), Some(keep_alive));
//! chain.sent(now);
//!
//! // The child does not answer. The line is free again after `ANSWER_MICROS`.
//! assert_eq!(chain.deadline(), Some(Micros::new(ANSWER_MICROS)));
//! ```

use crate::protocol::payload::{PAYLOAD_KEPT, payload};
use crate::protocol::requests::DISCOVERY;
use crate::protocol::{Address, BROADCAST, HOST, Packet};
use crate::units::Micros;
use heapless::Deque;

/// Longest time from the end of a request until the end of its answer, in microseconds. A hub answers within 2 ms, and
/// its longest answer takes 4 ms on the line.
pub const ANSWER_MICROS: u64 = 10_000;

/// Time for which a discovery waits for the hub at one address, in microseconds. Hosts wait about half a second for a
/// discovery: 254 addresses take 0.51 s plus the time to send the requests.
pub const SLOT_MICROS: u64 = 2_000;

/// Largest number of requests that wait for the chain line. Hosts wait for an answer before they send the next request,
/// or send up to eight requests to one hub.
const WAITING: usize = 8;

payload! {
    /// State of the chain line, as the parent has found it since its start.
    #[derive(Copy, Default)]
    pub struct ChainReport {
        /// True while a discovery has addresses to ask, or waits for an answer.
        pub discovering: bool,
        /// The addresses from which an answer has come. A discovery removes an address that does not answer.
        pub answering: Addresses,
        /// The addresses that more than one hub has. Two children answered the last discovery together, which damaged
        /// the answer, or a child answered with the address of the parent. A hub with such an address cannot be used.
        pub duplicate: Addresses,
    }
}

payload! {
    /// A set of addresses of hubs.
    #[derive(Copy, Default)]
    pub struct Addresses {
        /// Bit i of byte b is 1 if the address 8 b + i is in the set.
        pub bits: [u8; 32],
    }
}

impl Addresses {
    /// True if the address is in the set.
    pub fn has(&self, address: u8) -> bool {
        self.bits.get(usize::from(address / 8)).is_some_and(|byte| byte & 1 << (address % 8) != 0)
    }

    /// Adds the address to the set, or removes it.
    pub fn set(&mut self, address: u8, has: bool) {
        if let Some(byte) = self.bits.get_mut(usize::from(address / 8)) {
            let bit = 1 << (address % 8);
            *byte = if has { *byte | bit } else { *byte & !bit };
        }
    }

    /// Returns the addresses in ascending order.
    pub fn iter(&self) -> impl Iterator<Item = u8> + '_ {
        (0..=u8::MAX).filter(|address| self.has(*address))
    }
}

/// A request on the chain line that is not answered yet.
#[derive(Clone, Copy, Debug)]
struct PendingRequest {
    address: u8,
    /// Message number, to which the answer refers.
    number: u8,
    /// True if the request is part of a discovery.
    discovery: bool,
    /// Time at which the line is free again without an answer. `None` until the request has been sent.
    until: Option<Micros>,
    /// True if bytes have arrived after the request, and no packet since these bytes.
    received_bytes: bool,
}

/// The parent's end of the chain line: decides which packet is the next on the line, and which packets the parent
/// passes on to the host. The default is the state after a reset.
#[derive(Clone, Debug, Default)]
pub struct Chain {
    requests: Deque<Packet, WAITING>,
    /// The next request of a discovery. `None` once a discovery has sent a request to all addresses.
    discovery: Option<Packet>,
    pending: Option<PendingRequest>,
    /// The addresses that this hub has sent a request to.
    addressed: Addresses,
    /// See [`ChainReport::answering`].
    answering: Addresses,
    /// See [`ChainReport::duplicate`].
    duplicate: Addresses,
}

impl Chain {
    /// Returns the state of the chain line.
    pub fn report(&self) -> ChainReport {
        let discovering = self.discovery.is_some() || self.pending.is_some_and(|pending| pending.discovery);
        ChainReport { discovering, answering: self.answering, duplicate: self.duplicate }
    }

    /// Queues a host's request to another hub. The request is dropped if its payload has [`PAYLOAD_KEPT`] bytes or
    /// more, which no host sends. The request is also dropped if eight requests wait already. The host then repeats the
    /// request.
    pub fn request(&mut self, packet: Packet) {
        if packet.payload.len() < PAYLOAD_KEPT {
            let _ = self.requests.push_back(packet);
        }
    }

    /// Queues a stop to all hubs, and drops all waiting requests: a request to enable a motor must not follow the stop.
    pub fn stop(&mut self, packet: Packet) {
        self.requests.clear();
        let _ = self.requests.push_back(packet);
    }

    /// Begins a discovery on the chain line, in place of a discovery that is not finished. `request` is the host's
    /// packet, to which the children's answers refer.
    pub fn discover(&mut self, request: &Packet) {
        self.discovery = Some(Packet { destination: 1, id: DISCOVERY, ..request.clone() });
    }

    /// Notes that bytes have arrived, whether or not they form a packet.
    pub fn note_bytes(&mut self) {
        if let Some(pending) = &mut self.pending {
            pending.received_bytes = true;
        }
    }

    /// Takes an answer from the chain line. Returns the answer if the parent must pass the answer on to the host. `own`
    /// is the address of this hub.
    ///
    /// An answer that comes too late is passed on too: a host may still accept it, and learns that the child is there.
    /// Only the answer to the present request makes the line free.
    pub fn receive(&mut self, packet: Packet, own: Address) -> Option<Packet> {
        let Packet { source, reference, .. } = packet;
        if let Some(pending) = &mut self.pending {
            // The bytes that arrived were a packet, so no answers have collided.
            pending.received_bytes = false;
        }
        if packet.destination != HOST || !self.addressed.has(source) {
            return None;
        }
        self.pending.take_if(|pending| (pending.address, pending.number) == (source, reference));
        let is_duplicate = source == own.get();
        self.answering.set(source, true);
        self.duplicate.set(source, is_duplicate);
        (!is_duplicate).then_some(packet)
    }

    /// Returns the packet that must be sent now. `None` while an answer may still come, or if no packet waits. After
    /// the packet is sent, [`sent`](Self::sent) must be called.
    pub fn next(&mut self, now: Micros) -> Option<Packet> {
        if let Some(pending) = self.pending {
            if pending.until.is_none_or(|until| now < until) {
                return None;
            }
            self.pending = None;
            if pending.discovery {
                // No answer has arrived from this address. Bytes without a packet are answers that collided.
                self.duplicate.set(pending.address, pending.received_bytes);
                self.answering.set(pending.address, false);
            }
        }
        // A discovery takes half a second, so requests go first.
        let request = self.requests.pop_front();
        let discovery = request.is_none();
        let packet = request.or_else(|| self.next_of_discovery())?;
        self.addressed.set(packet.destination, true);
        self.pending = Some(PendingRequest {
            address: packet.destination,
            number: packet.number,
            discovery,
            until: None,
            received_bytes: false,
        });
        Some(packet)
    }

    /// Returns the request to the next address of a discovery.
    fn next_of_discovery(&mut self) -> Option<Packet> {
        let packet = self.discovery.take()?;
        let next = packet.destination.checked_add(1).filter(|next| *next != BROADCAST);
        self.discovery = next.map(|destination| Packet { destination, ..packet.clone() });
        Some(packet)
    }

    /// Notes that the last byte of the packet from [`next`](Self::next) has been sent.
    pub fn sent(&mut self, now: Micros) {
        if let Some(pending) = &mut self.pending {
            let wait = match pending.address {
                BROADCAST => 0,
                _ if pending.discovery => SLOT_MICROS,
                _ => ANSWER_MICROS,
            };
            pending.until = Some(Micros::new(now.get().saturating_add(wait)));
        }
    }

    /// Returns the time at which [`next`](Self::next) must be called even if nothing arrives. `None` if no time-out
    /// runs.
    pub fn deadline(&self) -> Option<Micros> {
        self.pending.and_then(|pending| pending.until)
    }
}
