//! Settings that outlast power: what the hub stores, when it stores it, and what it does with a stored record.
//!
//! A record has an entry for the address and for each [`Group`] of each motor's settings. An entry has the type and the
//! payload of the request that would set the group.
//!
//! ```text
//!        save, load, reset, or a new address          store_request()
//! idle -----------------------------------> requested -------> busy
//!   ^                                                            |
//!   '----------------------- carried_out() ----------------------'
//! ```

use super::Responder;
use super::motor::MotorChannel;
use crate::extension::HubFunction;
use crate::extension::settings::{Group, MotorSettings, Values};
use crate::extension::state::StoreReport;
use crate::hub::Snapshot;
use crate::motor::Settings;
use crate::protocol::payload::{Field, Fields, Payload};
use crate::protocol::{Address, CHANNELS, Nack, Reply};
use crate::store::{Entry, Found, Outcome, Record, StoreRequest, Stored};
use heapless::{CapacityError, Vec};

/// The type of the entry with the address, which is the packet type of REV's *set address*.
const ADDRESS: u16 = 0x7F06;

/// The most bytes of an entry's payload. A later firmware may store more fields behind those of this firmware.
const LONGEST_ENTRY: usize = u8::MAX as usize;

/// State of the memory for settings.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    found: Found,
    outcome: Outcome,
    phase: Phase,
    /// Entries of the last restored record that are unknown, and that were refused.
    unknown: u8,
    refused: u8,
    /// True if the address in force has yet to be stored.
    address_due: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Idle,
    Requested(Access),
    Busy(Access),
}

/// An access to the memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Access {
    Save,
    SaveAddress,
    Reset,
    Load,
}

impl Memory {
    fn new(found: Found) -> Self {
        let (outcome, phase) = (Outcome::None, Phase::Idle);
        Self { found, outcome, phase, unknown: 0, refused: 0, address_due: false }
    }

    /// Why nothing can be added to the stored record, if so.
    const fn refusal(&self) -> Option<Nack> {
        match self.found.stored {
            Stored::Later => Some(Nack::STORE_LATER),
            Stored::Damaged => Some(Nack::STORE_DAMAGED),
            Stored::Nothing | Stored::Whole | Stored::OneCopy => None,
        }
    }
}

impl<const N: usize> Responder<N> {
    /// Restores all settings that were found in the memory, with the address. To be called once after a reset.
    pub fn restore(&mut self, found: Found) {
        self.address = self.boot_address(&found.record);
        self.restore_settings(&found.record);
        let (unknown, refused) = count(&found.record, &self.channels);
        self.memory = Some(Memory { unknown, refused, ..Memory::new(found) });
    }

    /// A responder that waits for [`restore`](Self::restore).
    #[must_use]
    pub fn expecting_store(self) -> Self {
        Self { expects_store: true, ..self }
    }

    /// True until an expected memory has reported its contents.
    pub const fn awaits_store(&self) -> bool {
        self.expects_store && self.memory.is_none()
    }

    /// Starts a save, a load or a reset.
    pub(super) fn access_store(
        &mut self,
        request: &HubFunction,
        snapshot: &Snapshot<N>,
    ) -> Result<Reply, Nack> {
        let memory = self.memory.as_ref().ok_or(Nack::UNSUPPORTED)?;
        if memory.phase != Phase::Idle {
            return Err(Nack::STORE_BUSY);
        }
        let access = match request {
            HubFunction::Save => {
                memory.refusal().map_or(Ok(()), Err)?;
                self.record(&memory.found.record).map_err(|_| Nack::STORE_FULL)?;
                Access::Save
            }
            _ if !self.is_off(snapshot) => return Err(Nack::MOTOR_ENABLED),
            HubFunction::Load => Access::Load,
            _ => Access::Reset,
        };
        if access == Access::Reset {
            self.changed = true;
            self.restore_settings(&Record::new(0));
        }
        if let Some(memory) = &mut self.memory {
            memory.phase = Phase::Requested(access);
        }
        Ok(Reply::ACK)
    }

    /// Stores a new address later, unless the record has this address already.
    pub(super) fn store_address(&mut self) {
        let Some(memory) = &self.memory else { return };
        let due = memory.refusal().is_none() && self.boot_address(&memory.found.record) != self.address;
        if let Some(memory) = &mut self.memory {
            memory.address_due = due;
        }
    }

    /// The address that the hub has after a reset with this record.
    fn boot_address(&self, record: &Record) -> Address {
        let entries = record.entries().filter(|entry| entry.id == ADDRESS);
        entries.filter_map(|entry| address_of(&entry)).last().unwrap_or(self.factory_address)
    }

    /// The next access to the memory, if one is requested; [`carried_out`](Self::carried_out) reports its result.
    pub fn store_request(&mut self, snapshot: &Snapshot<N>) -> Option<StoreRequest> {
        let memory = self.memory.as_ref()?;
        let may_erase = self.is_off(snapshot);
        let stored = &memory.found.record;
        let access = match memory.phase {
            Phase::Busy(_) => return None,
            Phase::Requested(access) => access,
            Phase::Idle if !memory.address_due => return None,
            // An address that had no room waits until the memory may be erased.
            Phase::Idle if may_erase || memory.outcome != Outcome::NeedsErase => Access::SaveAddress,
            Phase::Idle => return None,
        };
        let record = match access {
            Access::Load => None,
            Access::Save => self.record(stored).ok(),
            Access::SaveAddress => self.record_with_address(stored).ok(),
            Access::Reset => Some(Record::new(stored.number().wrapping_add(1))),
        };
        let afresh = memory.found.stored == Stored::Damaged && access == Access::Reset;
        self.memory.as_mut()?.phase = Phase::Busy(access);
        Some(StoreRequest { record, afresh, may_erase })
    }

    /// Takes the result of the last access. `found` is the contents of the memory now; `None` if they have not changed.
    pub fn carried_out(&mut self, found: Option<Found>, outcome: Outcome) {
        let Some(before) = &self.memory else { return };
        let load = before.phase == Phase::Busy(Access::Load);
        let found = found.unwrap_or_else(|| before.found.clone());
        // The address may have changed during the access. After a failure the hub does not try again.
        let fails = matches!(outcome, Outcome::Refused | Outcome::Lost);
        let address_due = before.address_due && !fails && self.boot_address(&found.record) != self.address;
        if load {
            self.restore_settings(&found.record);
        }
        let (unknown, refused) = count(&found.record, &self.channels);
        self.memory = Some(Memory { outcome, unknown, refused, address_due, ..Memory::new(found) });
    }

    /// True if no motor is enabled by a host or otherwise.
    pub(super) fn is_off(&self, snapshot: &Snapshot<N>) -> bool {
        !self.channels.iter().any(MotorChannel::enabled) && snapshot.all_disabled()
    }

    /// The state of the memory.
    pub(super) fn store_report(&self) -> Result<StoreReport, Nack> {
        let memory = self.memory.as_ref().ok_or(Nack::UNSUPPORTED)?;
        let Memory { found: Found { stored, version, record }, outcome, unknown, refused, .. } = memory;
        let at_work = memory.phase != Phase::Idle;
        let coefficients = |channel: &MotorChannel| channel.settings().motor.coefficients.is_some();
        let motors = self.channels.iter().take(CHANNELS).enumerate();
        Ok(StoreReport {
            stored: *stored,
            version: *version,
            number: record.number(),
            at_work,
            outcome: *outcome,
            differs: self.changed && (at_work || self.differs(record)),
            unknown: *unknown,
            refused: *refused,
            coefficients: motors
                .fold(0, |bits, (motor, channel)| bits | u8::from(coefficients(channel)) << motor),
        })
    }

    /// True if a reset with this record would change settings or address.
    fn differs(&self, record: &Record) -> bool {
        let stored = |settings: &MotorSettings, group: Group| {
            group.in_use(settings).then(|| Values::of(group, settings))
        };
        let mut motors = (0..).zip(&self.channels).zip(self.factory);
        self.boot_address(record) != self.address
            || motors.any(|((motor, channel), factory)| {
                let restored = restored(motor, factory, record);
                let differs = |&group| stored(&restored, group) != stored(channel.settings(), group);
                Group::EACH.iter().any(differs)
            })
    }

    /// The next record: all settings in force, and the stored entries that this firmware does not know.
    fn record(&self, stored: &Record) -> Result<Record, CapacityError> {
        let mut record = Record::new(stored.number().wrapping_add(1));
        record.push(ADDRESS, &[self.address.get()])?;
        for (motor, channel) in (0..).zip(&self.channels) {
            let settings = channel.settings();
            for group in Group::EACH.into_iter().filter(|group| group.in_use(settings)) {
                let fields = payload(motor, &Values::of(group, settings));
                // A later firmware's fields behind those of this firmware are kept.
                let before = entries_of(stored, motor, group).last();
                let more = before.and_then(|entry| entry.payload.get(fields.len()..)).unwrap_or_default();
                let entry: Vec<u8, LONGEST_ENTRY> =
                    fields.iter().chain(more).copied().take(LONGEST_ENTRY).collect();
                record.push(group.set_id(), &entry)?;
            }
        }
        for entry in stored.entries().filter(|entry| judge(entry, &self.channels).is_none()) {
            record.push(entry.id, entry.payload)?;
        }
        Ok(record)
    }

    /// The next record: the stored entries with the address in force.
    fn record_with_address(&self, stored: &Record) -> Result<Record, CapacityError> {
        let mut record = Record::new(stored.number().wrapping_add(1));
        record.push(ADDRESS, &[self.address.get()])?;
        for entry in stored.entries().filter(|entry| entry.id != ADDRESS) {
            record.push(entry.id, entry.payload)?;
        }
        Ok(record)
    }

    /// Puts the firmware's settings in force, and then the settings of the record.
    fn restore_settings(&mut self, record: &Record) {
        for ((motor, channel), factory) in (0..).zip(&mut self.channels).zip(self.factory) {
            channel.restore(restored(motor, factory, record));
        }
    }
}

/// The settings of a motor after a reset with this record. Entries that are unknown or refused change nothing.
fn restored(motor: u8, factory: Settings, record: &Record) -> MotorSettings {
    let mut settings = MotorSettings::new(factory);
    for group in Group::EACH {
        let entry = entries_of(record, motor, group).last();
        let values = entry.and_then(|entry| values_of(&entry, motor, group, &settings).ok());
        // A set-up that changes nothing must not delete motion and coefficients.
        let changes = |values: &Values| !group.in_use(&settings) || *values != Values::of(group, &settings);
        if let Some(new) = values.filter(changes).and_then(|values| values.put(&settings).ok()) {
            settings = new;
        }
    }
    settings
}

/// The payload of the request that sets these values.
fn payload(motor: u8, values: &Values) -> Payload {
    let mut payload = Payload::new();
    values.group().write_name(motor, &mut payload);
    values.write(&mut payload);
    payload
}

/// The entries of a record that set a group of a motor's settings.
fn entries_of(record: &Record, motor: u8, group: Group) -> impl Iterator<Item = Entry<'_>> {
    record.entries().filter(move |entry| sets(entry, motor, group))
}

fn sets(entry: &Entry<'_>, motor: u8, group: Group) -> bool {
    let mut name = Payload::new();
    group.write_name(motor, &mut name);
    entry.id == group.set_id() && entry.payload.starts_with(&name)
}

/// The values of an entry. Fields that an earlier firmware did not store are as in `settings`.
fn values_of(entry: &Entry<'_>, motor: u8, group: Group, settings: &MotorSettings) -> Result<Values, Nack> {
    let mut payload = payload(motor, &Values::of(group, settings));
    for (byte, stored) in payload.iter_mut().zip(entry.payload) {
        *byte = *stored;
    }
    let mut name = Payload::new();
    group.write_name(motor, &mut name);
    let values = Values::read(group, &mut Fields::new(payload.get(name.len()..).unwrap_or_default()))?;
    values.put(settings).map(|_| values)
}

fn address_of(entry: &Entry<'_>) -> Option<Address> {
    Address::read(&mut Fields::new(entry.payload)).ok()
}

/// True if this firmware accepts the entry, false if it refuses the entry; `None` if it does not know the entry.
fn judge(entry: &Entry<'_>, channels: &[MotorChannel]) -> Option<bool> {
    if entry.id == ADDRESS {
        return Some(address_of(entry).is_some());
    }
    let motor = *entry.payload.first()?;
    let settings = channels.get(usize::from(motor))?.settings();
    let group = Group::EACH.into_iter().find(|group| sets(entry, motor, *group))?;
    Some(values_of(entry, motor, group, settings).is_ok())
}

/// The numbers of entries that are unknown, and that are refused.
fn count(record: &Record, channels: &[MotorChannel]) -> (u8, u8) {
    record.entries().fold((0u8, 0u8), |(unknown, refused), entry| match judge(&entry, channels) {
        None => (unknown.saturating_add(1), refused),
        Some(false) => (unknown, refused.saturating_add(1)),
        Some(true) => (unknown, refused),
    })
}
