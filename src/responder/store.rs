//! Settings that outlast power: what of a hub is stored, as requests that say it anew, and what is asked of whoever has the
//! memory.

use super::motor::MotorChannel;
use super::{Answer, Responder};
use crate::hub::Snapshot;
use crate::motor::{Report, Settings};
use crate::protocol::fields::{Field, Payload};
use crate::protocol::motor::{ChannelMode, Loop, ToMotor};
use crate::protocol::requests::Standard;
use crate::protocol::setup::{Motion, Protection, ToSetup};
use crate::protocol::store::{StoreReport, ToStore};
use crate::protocol::{Address, CHANNELS, Nack, Packet, Request};
use crate::responder::setup;
use crate::store::{Entry, Found, Full, Order, Outcome, Record, Stored};
use heapless::Vec;

/// Requests that together say all settings of a motor.
const STEPS: usize = 8;

/// A request that is part of a record.
struct Saying {
    request: Request,
    /// Its first bytes, which name what is set and not to what.
    name: Name,
    /// A host has said it, or it always holds; otherwise it is not stored.
    holds: bool,
}

/// The motor, or the motor and its loop.
type Name = Vec<u8, 2>;

/// The most bytes of an entry: more than a message holds, as a later firmware may store more behind a setting's fields.
const LONGEST_ENTRY: usize = u8::MAX as usize;

/// What is known of the memory; without one nobody ever tells.
#[derive(Clone, Debug)]
pub(super) struct Keeping {
    found: Found,
    outcome: Outcome,
    wish: Wish,
    /// Entries of the record last put in force that are unknown, and that were refused.
    unknown: u8,
    refused: u8,
    /// The address in force is to be stored.
    address_due: bool,
}

/// What is wanted of the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wish {
    None,
    Save,
    SaveAddress,
    Reset,
    Load,
    /// An order is being carried out; what it reads is put in force if so.
    AtWork {
        load: bool,
    },
}

impl Keeping {
    fn new(found: Found) -> Self {
        let (outcome, wish) = (Outcome::None, Wish::None);
        Self { found, outcome, wish, unknown: 0, refused: 0, address_due: false }
    }

    /// Nothing can be added to what is there.
    const fn refusal(&self) -> Option<Nack> {
        match self.found.stored {
            Stored::Later => Some(Nack::STORE_LATER),
            Stored::Damaged => Some(Nack::STORE_DAMAGED),
            Stored::Nothing | Stored::Whole | Stored::OneCopy => None,
        }
    }
}

impl<const N: usize> Responder<N> {
    /// After a reset, before anything else: there is a memory for settings, and this was found in it. All of it is put
    /// in force, the address too.
    pub fn restore(&mut self, found: Found) {
        self.address = address_of(&found.record).unwrap_or(self.address);
        self.put_in_force(&found.record);
        let (unknown, refused) = self.counted(&found.record);
        self.keeping = Some(Keeping { unknown, refused, ..Keeping::new(found) });
    }

    /// There is a memory for settings, which has yet to tell what is in it.
    #[must_use]
    pub fn expecting_store(self) -> Self {
        Self { expects_store: true, ..self }
    }

    /// That has not been told yet.
    pub const fn awaits_store(&self) -> bool {
        self.expects_store && self.keeping.is_none()
    }

    /// Does what a request says.
    pub(super) fn receive_store(&mut self, request: ToStore, snapshot: &Snapshot<N>) -> Result<Answer, Nack> {
        let runs = !self.is_off(snapshot);
        let keeping = self.keeping.as_ref().ok_or(Nack::UNSUPPORTED)?;
        let wish = match request {
            ToStore::State => return Ok(Answer::data(&self.store_report(keeping))),
            _ if keeping.wish != Wish::None => return Err(Nack::STORE_AT_WORK),
            ToStore::Save => {
                keeping.refusal().map_or(Ok(()), Err)?;
                self.record(&keeping.found.record, self.address).map_err(|Full| Nack::STORE_FULL)?;
                Wish::Save
            }
            ToStore::Load | ToStore::Reset if runs => return Err(Nack::MOTOR_ENABLED),
            ToStore::Load => Wish::Load,
            ToStore::Reset => Wish::Reset,
        };
        if wish == Wish::Reset {
            self.changed = true;
            self.put_in_force(&Record::new(0));
        }
        if let Some(keeping) = &mut self.keeping {
            keeping.wish = wish;
        }
        Ok(Answer::Ack)
    }

    /// A host has set the address, which is stored unless it is already.
    pub(super) fn keep_address(&mut self) {
        let Some(keeping) = &self.keeping else { return };
        let due = keeping.refusal().is_none() && self.boot_address(&keeping.found.record) != self.address;
        if let Some(keeping) = &mut self.keeping {
            keeping.address_due = due;
        }
    }

    /// The one that the hub has after a reset, with this record stored.
    fn boot_address(&self, record: &Record) -> Address {
        address_of(record).unwrap_or(self.factory_address)
    }

    /// What whoever has the memory is to do, if anything; [`carried_out`](Self::carried_out) when it is done.
    pub fn order(&mut self, snapshot: &Snapshot<N>) -> Option<Order> {
        let keeping = self.keeping.as_ref()?;
        if matches!(keeping.wish, Wish::AtWork { .. }) || keeping.wish == Wish::None && !keeping.address_due {
            return None;
        }
        let may_erase = self.is_off(snapshot);
        let stored = &keeping.found.record;
        let afresh = keeping.found.stored == Stored::Damaged;
        let wish = match keeping.wish {
            // One that had no room waits until it may erase.
            Wish::None if may_erase || keeping.outcome != Outcome::NeedsErase => Wish::SaveAddress,
            wish => wish,
        };
        let next = stored.number().wrapping_add(1);
        let record = match wish {
            Wish::None | Wish::AtWork { .. } => return None,
            Wish::Load => None,
            Wish::Save => self.record(stored, self.address).ok(),
            Wish::SaveAddress => with_address(stored, self.address).ok(),
            Wish::Reset => Some(Record::new(next)),
        };
        let keeping = self.keeping.as_mut()?;
        keeping.wish = Wish::AtWork { load: wish == Wish::Load };
        Some(Order { record, afresh: afresh && wish == Wish::Reset, may_erase })
    }

    /// The last order has been carried out, or could not be. This is stored now; `None` if that is as it was.
    pub fn carried_out(&mut self, found: Option<Found>, outcome: Outcome) {
        let load = self.keeping.as_ref().is_some_and(|keeping| keeping.wish == Wish::AtWork { load: true });
        let Some(before) = &self.keeping else { return };
        let found = found.unwrap_or_else(|| before.found.clone());
        // It may have been set meanwhile. A memory that fails is not tried for ever.
        let fails = matches!(outcome, Outcome::Refused | Outcome::Lost);
        let address_due = before.address_due && !fails && self.boot_address(&found.record) != self.address;
        if load {
            self.put_in_force(&found.record);
        }
        let (unknown, refused) = self.counted(&found.record);
        self.keeping = Some(Keeping { outcome, unknown, refused, address_due, ..Keeping::new(found) });
    }

    /// No host has a motor enabled, and none does anything.
    pub(super) fn is_off(&self, snapshot: &Snapshot<N>) -> bool {
        !self.channels.iter().any(MotorChannel::enabled) && snapshot.all_disabled()
    }

    fn store_report(&self, keeping: &Keeping) -> StoreReport {
        let Keeping { found: Found { stored, version, record }, outcome, unknown, refused, .. } = keeping;
        StoreReport {
            stored: *stored,
            version: *version,
            number: record.number(),
            at_work: keeping.wish != Wish::None,
            outcome: *outcome,
            differs: self.changed && (keeping.wish != Wish::None || self.differs(record)),
            unknown: *unknown,
            refused: *refused,
            coefficients: self
                .channels
                .iter()
                .take(CHANNELS)
                .enumerate()
                .fold(0, |bits, (motor, channel)| {
                    bits | u8::from(channel.settings().coefficients.is_some()) << motor
                }),
        }
    }

    /// After a reset other settings would be in force, with this record stored.
    fn differs(&self, record: &Record) -> bool {
        let mut motors = (0..).zip(&self.channels).zip(self.factory);
        self.boot_address(record) != self.address
            || motors.any(|((motor, channel), settings)| {
                let mut started = MotorChannel::new(settings);
                put_in_force(&mut started, motor, settings, record, N);
                let said = |channel| move |step| saying(channel, motor, step).map(Saying::held);
                !(0..STEPS).map(said(&started)).eq((0..STEPS).map(said(channel)))
            })
    }

    /// All settings in force, and what of `stored` this firmware does not know, as the next save.
    fn record(&self, stored: &Record, address: Address) -> Result<Record, Full> {
        let mut record = Record::new(stored.number().wrapping_add(1));
        let address = Request::from(Standard::SetAddress { address });
        record.push(address.id(), &address.payload())?;
        for (motor, channel) in (0..).zip(&self.channels) {
            for saying in (0..STEPS).filter_map(|step| saying(channel, motor, step)) {
                if saying.holds {
                    record.push(saying.request.id(), &saying.stored_with(stored))?;
                }
            }
        }
        for entry in stored.entries().filter(|entry| !self.knows(entry)) {
            record.push(entry.id, entry.payload)?;
        }
        Ok(record)
    }

    /// Makes the settings in force what the firmware has, and then what the record says. What this firmware does not
    /// know, or does not take, changes nothing.
    fn put_in_force(&mut self, record: &Record) {
        for ((motor, channel), settings) in (0..).zip(&mut self.channels).zip(self.factory) {
            put_in_force(channel, motor, settings, record, N);
        }
    }

    /// Of a record's entries, those that are unknown, and those that are not taken.
    fn counted(&self, record: &Record) -> (u8, u8) {
        record.entries().fold((0u8, 0u8), |(unknown, refused), entry| match self.judge(&entry) {
            None => (unknown.saturating_add(1), refused),
            Some(false) => (unknown, refused.saturating_add(1)),
            Some(true) => (unknown, refused),
        })
    }

    fn knows(&self, entry: &Entry<'_>) -> bool {
        self.judge(entry).is_some()
    }

    /// Whether it is taken; `None` for what is unknown.
    fn judge(&self, entry: &Entry<'_>) -> Option<bool> {
        let address = Request::from(Standard::SetAddress { address: self.address });
        if entry.id == address.id() {
            return Some(read_address(entry).is_some());
        }
        let motor = *entry.payload.first()?;
        let channel = self.channels.get(usize::from(motor))?;
        let mut sayings = (0..STEPS).filter_map(|step| saying(channel, motor, step));
        sayings.find(|saying| saying.is_said_by(entry)).map(|saying| saying.said_with(entry, N).is_ok())
    }
}

impl Saying {
    fn is_said_by(&self, entry: &Entry<'_>) -> bool {
        entry.id == self.request.id() && entry.payload.starts_with(&self.name)
    }

    /// Its fields, and behind them what a later firmware has stored that this one does not know.
    fn stored_with(&self, stored: &Record) -> Vec<u8, LONGEST_ENTRY> {
        let fields = self.request.payload();
        let before = stored.entries().filter(|entry| self.is_said_by(entry)).last();
        let more = before.and_then(|entry| entry.payload.get(fields.len()..)).unwrap_or_default();
        fields.iter().chain(more).copied().take(LONGEST_ENTRY).collect()
    }

    /// The request, if it is stored.
    fn held(self) -> Option<Request> {
        self.holds.then_some(self.request)
    }

    /// What an entry says, its missing fields as they are now.
    fn said_with(&self, entry: &Entry<'_>, motors: usize) -> Result<Request, Nack> {
        let mut payload = self.request.payload();
        for (now, said) in payload.iter_mut().zip(entry.payload) {
            *now = *said;
        }
        Request::read(&packet(entry.id, payload), motors)
    }
}

/// Makes a motor's settings what the firmware has, and then what the record says, of so many motors.
fn put_in_force(channel: &mut MotorChannel, motor: u8, settings: Settings, record: &Record, motors: usize) {
    channel.forget_settings(settings);
    for step in 0..STEPS {
        let Some(saying) = saying(channel, motor, step) else { continue };
        let entry = record.entries().filter(|entry| saying.is_said_by(entry)).last();
        let Some(Ok(request)) = entry.map(|entry| saying.said_with(&entry, motors)) else { continue };
        // What is so already must not make a set-up forget what belongs to it.
        if !(saying.holds && request == saying.request) {
            say(channel, request);
        }
    }
}

/// One of the requests that say all of a motor's settings, in an order in which none undoes another.
fn saying(channel: &MotorChannel, motor: u8, step: usize) -> Option<Saying> {
    let settings = channel.settings();
    let coefficients = |of| {
        let request = ToMotor::SetPidf { of, coefficients: channel.pidf(of) }.to(motor);
        let mut name = Payload::new();
        [motor].write(&mut name);
        of.write(&mut name);
        let name = name.iter().copied().collect();
        Saying { request, name, holds: settings.coefficients.is_some() }
    };
    let request = match step {
        // Forgets motion and coefficients.
        0 => ToSetup::SetUp { setup: setup::of(settings) }.to(motor),
        1 => ToSetup::SetTiming { timing: settings.bridge.timing() }.to(motor),
        2 => {
            let protection = Protection { on_fault: settings.on_fault, thermal: settings.thermal };
            ToSetup::SetProtection { protection }.to(motor)
        }
        3 => {
            let motion = Motion { dynamics: settings.dynamics, acceleration: settings.acceleration };
            ToSetup::SetMotion { motion }.to(motor)
        }
        4 => {
            let ChannelMode { mode, zero_power } = channel.mode();
            ToMotor::SetMode { mode, zero_power }.to(motor)
        }
        5 => ToMotor::SetCurrentAlert { milliamperes: channel.current_alert() }.to(motor),
        6 => return Some(coefficients(Loop::Velocity)),
        7 => return Some(coefficients(Loop::Position)),
        _ => return None,
    };
    Some(Saying { request, name: [motor].into_iter().collect(), holds: true })
}

/// None of these requests looks at a report, or is refused.
fn say(channel: &mut MotorChannel, request: Request) {
    let _ = match request {
        Request::Motor(_, request) => channel.receive(request, &Report::INITIAL, false),
        Request::Setup(_, request) => channel.receive_setup(request, &Report::INITIAL, None),
        _ => return,
    };
}

/// What is stored with another address.
fn with_address(stored: &Record, address: Address) -> Result<Record, Full> {
    let request = Request::from(Standard::SetAddress { address });
    let mut record = Record::new(stored.number().wrapping_add(1));
    record.push(request.id(), &request.payload())?;
    for entry in stored.entries().filter(|entry| entry.id != request.id()) {
        record.push(entry.id, entry.payload)?;
    }
    Ok(record)
}

/// The address that a record gives the hub.
fn address_of(record: &Record) -> Option<Address> {
    record.entries().filter_map(|entry| read_address(&entry)).last()
}

fn read_address(entry: &Entry<'_>) -> Option<Address> {
    let payload = Payload::from_slice(entry.payload).ok()?;
    match Request::read(&packet(entry.id, payload), 0) {
        Ok(Request::Standard(Standard::SetAddress { address })) => Some(address),
        _ => None,
    }
}

fn packet(id: u16, payload: Payload) -> Packet {
    Packet { destination: 0, source: 0, number: 0, reference: 0, id, payload }
}
