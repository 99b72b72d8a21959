//! Stored settings: what the hub stores, when it stores settings, and how it restores them.
//!
//! * The *memory* keeps settings without power. The task `tasks::store` accesses the memory.
//! * A *record* has entries. A save that a host requests writes an entry for the address, one for each configured
//!   [`Group`] of each motor's settings, and one for a configured drive base. Entries that this firmware does not know
//!   are kept. An entry has the type and the payload of the request that would set the same values. Of two entries for
//!   the same values, the last one counts. An entry for coefficients may have no values: it stands for coefficients
//!   that are not configured, which no request can set. The request *reset* writes a record without entries.
//! * An *access* writes a record to the memory, or reads the record from it.
//!
//! ```text
//!          save, load or reset                      store_request()
//!       .---------------------> SaveRequested, -----------------------.
//!       |                       LoadRequested,                        v
//!       |                       ResetRequested                 Writing, Loading
//!       |                                                             ^  |
//!     Idle ---------------------- store_request() --------------------'  |
//!       ^              an address must be stored                         |
//!       '----------------------- store_done() ---------------------------'
//! ```
//!
//! When a host has set an address, the hub stores the address without a request to save. The hub first waits for the
//! end of a running access. If the memory must be erased, the hub also waits until all motors are off. A save that
//! has no room in the record leads back to `Idle`, and the memory does not change.

use super::Responder;
use super::motor::MotorChannel;
use crate::extension::FIRST_FUNCTION;
use crate::extension::settings::{Group, MotorSettings, Values};
use crate::extension::state::StoreReport;
use crate::group::BaseSettings;
use crate::hub::Snapshot;
use crate::motor::Settings;
use crate::protocol::payload::{Field, Fields, Payload, byte};
use crate::protocol::{Address, CHANNELS, Nack, Reply};
use crate::store::{Entry, Found, Outcome, SettingsRecord, StoreRequest, Stored};
use heapless::CapacityError;

/// Type of the entry with the address: the packet type of REV's *set address*.
const ADDRESS: u16 = 0x7F06;

/// Type of the entry with the drive base: the packet type of the extension's function 34.
const BASE: u16 = FIRST_FUNCTION + 34;

/// Contents and state of the memory.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    /// Contents of the memory after the last access.
    found: Found,
    /// Result of the last access.
    outcome: Outcome,
    access: Access,
}

/// State of the access to the memory. A state whose name ends with `Requested` lasts until the task takes the request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Access {
    /// No access is requested or running.
    Idle,
    /// A host has requested to write the settings and the address in force.
    SaveRequested,
    /// A host has requested to write an empty record. The settings that the firmware was built with are in force since
    /// the request.
    ResetRequested,
    /// A host has requested to read the record.
    LoadRequested,
    /// The task writes a record.
    Writing,
    /// The task reads the record. The record's settings come into force at the end of the access.
    Loading,
}

impl Memory {
    fn new(found: Found) -> Self {
        Self { found, outcome: Outcome::None, access: Access::Idle }
    }

    /// Returns why the contents of the memory prevent a save. `None` if a save is possible. The contents never prevent
    /// a reset.
    const fn save_refusal(&self) -> Option<Nack> {
        match self.found.stored {
            Stored::Later => Some(Nack::STORE_LATER),
            Stored::Damaged => Some(Nack::STORE_DAMAGED),
            Stored::Nothing | Stored::Whole | Stored::OneCopy => None,
        }
    }
}

impl<const N: usize> Responder<N> {
    /// Restores settings and address from the contents of the memory. Must be called once after the hub has started.
    ///
    /// If a host has already sent a packet, settings and address in force do not change. The hub reports whether they
    /// differ from the memory, and the host may load the stored settings.
    pub fn restore(&mut self, found: Found) {
        if !self.keep_alive.has_received_packet() {
            self.address = self.boot_address(&found.record);
            self.restore_settings(&found.record);
        }
        self.memory = Some(Memory::new(found));
        if self.address_due {
            self.store_address();
        }
    }

    /// Makes the responder wait for [`restore`](Self::restore): [`awaits_store`](Self::awaits_store) returns true until
    /// then.
    #[must_use]
    pub const fn expecting_store(mut self) -> Self {
        self.expects_store = true;
        self
    }

    /// True if the responder expects stored settings that are not restored yet.
    pub const fn awaits_store(&self) -> bool {
        self.expects_store && self.memory.is_none()
    }

    /// Records the access that a host requests, for [`store_request`](Self::store_request). A reset changes the
    /// settings in force immediately. The address in force stays until the next start of the hub.
    ///
    /// # Errors
    /// Refuses the request if the hub has no memory, while another access is running, or before the task has reported
    /// the contents. A save is refused if the stored record is damaged or has a later format version, or if the
    /// settings do not fit. Load and reset are refused unless all motors are [off](Self::is_off).
    pub(super) fn access_store(&mut self, requested: Access, snapshot: &Snapshot<N>) -> Result<Reply, Nack> {
        let memory = self.memory.as_ref().ok_or(self.refusal_without_memory())?;
        if memory.access != Access::Idle {
            return Err(Nack::STORE_BUSY);
        }
        match requested {
            Access::SaveRequested => {
                memory.save_refusal().map_or(Ok(()), Err)?;
                self.record_of_all(&memory.found.record).map_err(|_| Nack::STORE_FULL)?;
            }
            _ if !self.is_off(snapshot) => return Err(Nack::MOTOR_ENABLED),
            Access::ResetRequested => self.restore_settings(&SettingsRecord::new(0)),
            _ => (),
        }
        if let Some(memory) = &mut self.memory {
            memory.access = requested;
        }
        Ok(Reply::ACK)
    }

    /// Marks the address in force to be stored, if the hub would start with another address. An access that is running
    /// may change the stored address, so [`store_done`](Self::store_done) compares again. The address is not stored if
    /// the contents of the memory prevent a save. Before the task has reported the contents, the address waits.
    pub(super) fn store_address(&mut self) {
        self.address_due = match &self.memory {
            Some(memory) => {
                let is_stored = self.boot_address(&memory.found.record) == self.address;
                memory.save_refusal().is_none() && !(is_stored && memory.access == Access::Idle)
            }
            None => self.expects_store,
        };
    }

    /// Returns the address that the hub would have after a restart with this record.
    fn boot_address(&self, record: &SettingsRecord) -> Address {
        let entries = record.entries().filter(|entry| entry.id == ADDRESS);
        entries.filter_map(|entry| address_of(&entry)).last().unwrap_or(self.factory_address)
    }

    /// Returns the next access, for the task. `None` if no access is due, if the record has no room, while an access is
    /// running, and while an address waits until all motors are off.
    ///
    /// The task must report the result to [`store_done`](Self::store_done).
    pub fn store_request(&mut self, snapshot: &Snapshot<N>) -> Option<StoreRequest> {
        let memory = self.memory.as_ref()?;
        let may_erase = self.is_off(snapshot);
        let stored = &memory.found.record;
        let record = match memory.access {
            Access::Writing | Access::Loading => return None,
            Access::LoadRequested => Ok(None),
            Access::ResetRequested => Ok(Some(next_record(stored))),
            Access::SaveRequested => self.record_of_all(stored).map(Some),
            Access::Idle if !self.address_due => return None,
            // The last access needed an erasure, which is only allowed while all motors are off. So the address waits.
            Access::Idle if !may_erase && memory.outcome == Outcome::NeedsErase => return None,
            Access::Idle => self.record_of_address(stored).map(Some),
        };
        let memory = self.memory.as_mut()?;
        let Ok(record) = record else {
            // The record has no room, because settings have changed since the request, or because of the entries of
            // other firmware. After a save without room the address is still due: a record of the address alone may
            // have room.
            self.address_due &= memory.access != Access::Idle;
            (memory.access, memory.outcome) = (Access::Idle, Outcome::Refused);
            return None;
        };
        let erase_first = memory.found.stored == Stored::Damaged && memory.access == Access::ResetRequested;
        memory.access = if record.is_some() { Access::Writing } else { Access::Loading };
        Some(StoreRequest { record, erase_first, may_erase })
    }

    /// Ends the running access with its result. A load that has succeeded puts the stored settings in force.
    ///
    /// `found` is the contents of the memory after the access. `None` if the memory must be erased before it can be
    /// read, and a motor is not off. The contents are then unchanged.
    pub fn store_done(&mut self, found: Option<Found>, outcome: Outcome) {
        let Some(before) = &self.memory else {
            // The hub no longer waits for stored settings, and this is the first report of the task.
            if let Some(found) = found {
                self.restore(found);
            }
            return;
        };
        let has_loaded = before.access == Access::Loading && outcome == Outcome::Done;
        let found = found.unwrap_or_else(|| before.found.clone());
        // If a host has changed the address during the access, the address is still due. After a failure of the memory
        // the hub does not try again.
        let failed = matches!(outcome, Outcome::Refused | Outcome::Lost);
        self.address_due &= !failed && self.boot_address(&found.record) != self.address;
        if has_loaded {
            self.restore_settings(&found.record);
        }
        self.memory = Some(Memory { outcome, ..Memory::new(found) });
    }

    /// Returns the refusal of requests that need a memory, on a hub without a memory or before the task has reported
    /// the contents.
    const fn refusal_without_memory(&self) -> Nack {
        if self.expects_store { Nack::STORE_BUSY } else { Nack::UNSUPPORTED }
    }

    /// True while a load is requested or runs. The load will change the settings of the motors, so no motor may be
    /// enabled.
    pub(super) fn is_loading(&self) -> bool {
        let access = self.memory.as_ref().map(|memory| memory.access);
        matches!(access, Some(Access::LoadRequested | Access::Loading))
    }

    /// True if no host has enabled a motor, and all motors are disabled or in fail-safe in the snapshot.
    pub(super) fn is_off(&self, snapshot: &Snapshot<N>) -> bool {
        !self.channels.iter().any(MotorChannel::enabled) && snapshot.all_disabled()
    }

    /// Reports the state of the memory.
    ///
    /// # Errors
    /// Returns [`Nack::UNSUPPORTED`] if the hub has no memory, and [`Nack::STORE_BUSY`] before the task has reported
    /// the contents.
    pub(super) fn store_report(&self) -> Result<StoreReport, Nack> {
        let memory = self.memory.as_ref().ok_or(self.refusal_without_memory())?;
        let Memory { found: Found { stored, version, record }, outcome, .. } = memory;
        let (mut unknown, mut refused) = (0u8, 0u8);
        for entry in record.entries() {
            match self.is_accepted(&entry) {
                Some(true) => (),
                Some(false) => refused = refused.saturating_add(1),
                None => unknown = unknown.saturating_add(1),
            }
        }
        let motors = self.channels.iter().take(CHANNELS);
        Ok(StoreReport {
            stored: *stored,
            version: *version,
            number: record.number(),
            is_busy: memory.access != Access::Idle,
            outcome: *outcome,
            differs: self.differs_from_memory(record),
            unknown,
            refused,
            coefficients: byte(motors.map(|channel| channel.settings().motor.coefficients.is_some())),
        })
    }

    /// True if settings, address or drive base in force would change at a restart with this record.
    fn differs_from_memory(&self, record: &SettingsRecord) -> bool {
        let stored = |settings: &MotorSettings, group: Group| {
            group.is_configured(settings).then(|| Values::of(group, settings))
        };
        let mut motors = (0..).zip(&self.channels).zip(self.factory);
        self.boot_address(record) != self.address
            || self.base_differs(record)
            || motors.any(|((motor, channel), factory)| {
                let restored = restored_settings(motor, factory, record);
                let differs = |&group| stored(&restored, group) != stored(channel.settings(), group);
                Group::ALL.iter().any(differs)
            })
    }

    /// Builds the record with the settings and the address in force. The record keeps the entries and the fields of
    /// `stored` that this firmware does not know.
    ///
    /// # Errors
    /// Returns [`CapacityError`] if the record has no room.
    fn record_of_all(&self, stored: &SettingsRecord) -> Result<SettingsRecord, CapacityError> {
        let mut record = next_record(stored);
        record.push(ADDRESS, &[self.address.get()])?;
        for ((motor, channel), factory) in (0..).zip(&self.channels).zip(&self.factory) {
            let settings = channel.settings();
            // Without an entry, a setting that the firmware was built with would be in force after a restart.
            let factory = MotorSettings::new(*factory);
            let is_stored = |group: &Group| group.is_configured(settings) || group.is_configured(&factory);
            for group in Group::ALL.into_iter().filter(is_stored) {
                if group.loop_of().is_some() && !group.is_configured(settings) {
                    record.push(group.set_id(), &name_of(group, motor))?;
                    continue;
                }
                let fields = request_payload(motor, &Values::of(group, settings));
                let older = entries_of(stored, motor, group).last().map(|entry| entry.payload);
                record.push_over(group.set_id(), &fields, older.unwrap_or_default())?;
            }
        }
        if let Some(base) = self.base {
            let mut fields = Payload::new();
            base.write(&mut fields);
            let older = newest_base(stored).map(|entry| entry.payload);
            record.push_over(BASE, &fields, older.unwrap_or_default())?;
        }
        for entry in stored.entries().filter(|entry| self.is_accepted(entry).is_none()) {
            record.push(entry.id, entry.payload)?;
        }
        Ok(record)
    }

    /// Builds the record with the address in force and all other entries of `stored`.
    ///
    /// # Errors
    /// Returns [`CapacityError`] if the record has no room.
    fn record_of_address(&self, stored: &SettingsRecord) -> Result<SettingsRecord, CapacityError> {
        let mut record = next_record(stored);
        record.push(ADDRESS, &[self.address.get()])?;
        for entry in stored.entries().filter(|entry| entry.id != ADDRESS) {
            record.push(entry.id, entry.payload)?;
        }
        Ok(record)
    }

    /// Returns the drive base that the hub would have after a restart with this record.
    fn stored_base(&self, record: &SettingsRecord) -> Option<BaseSettings> {
        newest_base(record).and_then(|entry| self.base_of(&entry))
    }

    /// True if the drive base in force would change at a restart with this record.
    fn base_differs(&self, record: &SettingsRecord) -> bool {
        self.stored_base(record) != self.base
    }

    /// Reads a drive base from an entry. `None` if a value is out of range, or if the hub lacks a wheel or a bus for
    /// the gyro.
    fn base_of(&self, entry: &Entry<'_>) -> Option<BaseSettings> {
        let base = BaseSettings::read(&mut Fields::new(entry.payload)).ok()?;
        self.check_base(&base).ok().map(|()| base)
    }

    /// Returns `Some(true)` if this firmware accepts the entry, and `Some(false)` if this firmware refuses the entry.
    /// `None` if this firmware does not know what the entry sets, or if the hub does not have the motor.
    fn is_accepted(&self, entry: &Entry<'_>) -> Option<bool> {
        if entry.id == ADDRESS {
            return Some(address_of(entry).is_some());
        }
        if entry.id == BASE {
            return Some(self.base_of(entry).is_some());
        }
        let motor = *entry.payload.first()?;
        let settings = self.channels.get(usize::from(motor))?.settings();
        let group = Group::ALL.into_iter().find(|group| value_bytes(entry, motor, *group).is_some())?;
        Some(values_of(entry, motor, group, settings).is_ok())
    }

    /// Puts in force the settings that the hub would have after a restart with this record. If the configuration of the
    /// drive base does not change, its odometry continues.
    fn restore_settings(&mut self, record: &SettingsRecord) {
        for ((motor, channel), factory) in (0..).zip(&mut self.channels).zip(self.factory) {
            channel.restore(restored_settings(motor, factory, record));
        }
        if self.base_differs(record) {
            self.command_base(self.stored_base(record));
        }
    }
}

/// Returns the settings that a motor would have after a restart with this record: the firmware's settings, changed by
/// the entries of the record. Unknown and refused entries have no effect.
fn restored_settings(motor: u8, factory: Settings, record: &SettingsRecord) -> MotorSettings {
    let mut settings = MotorSettings::new(factory);
    for group in Group::ALL {
        let Some(entry) = entries_of(record, motor, group).last() else { continue };
        if group.loop_of().is_some() && value_bytes(&entry, motor, group) == Some(&[]) {
            settings.motor.coefficients = None;
            continue;
        }
        let Ok(values) = values_of(&entry, motor, group, &settings) else { continue };
        // Applying the group `SetUp` deletes dynamics, acceleration limit and coefficients. The firmware may have been
        // built with these settings, so a set-up whose values do not change is not applied.
        let changes = group != Group::SetUp || values != Values::of(group, &settings);
        if changes && let Ok(new) = values.apply_to(&settings) {
            settings = new;
        }
    }
    settings
}

/// Creates the record of the next save, without entries.
fn next_record(stored: &SettingsRecord) -> SettingsRecord {
    SettingsRecord::new(stored.number().wrapping_add(1))
}

/// Returns the payload of the request that sets these values.
fn request_payload(motor: u8, values: &Values) -> Payload {
    let mut payload = name_of(values.group(), motor);
    values.write(&mut payload);
    payload
}

/// Returns the bytes with which the payload of every request and entry begins that sets this group of this motor's
/// settings. The values of the group follow these bytes.
fn name_of(group: Group, motor: u8) -> Payload {
    let mut name = Payload::new();
    group.write_name(motor, &mut name);
    name
}

/// Iterates over the entries of a record that set this group of this motor's settings.
fn entries_of(record: &SettingsRecord, motor: u8, group: Group) -> impl Iterator<Item = Entry<'_>> {
    record.entries().filter(move |entry| value_bytes(entry, motor, group).is_some())
}

/// Returns the values of an entry as bytes. `None` if the entry does not set this group of this motor's settings.
fn value_bytes<'a>(entry: &Entry<'a>, motor: u8, group: Group) -> Option<&'a [u8]> {
    if entry.id != group.set_id() {
        return None;
    }
    entry.payload.strip_prefix(name_of(group, motor).as_slice())
}

/// Reads the values of an entry. A field that is missing, because an earlier firmware stored the entry, is taken from
/// `settings`.
///
/// # Errors
/// Refuses values that are out of range, or that do not fit the other settings.
fn values_of(entry: &Entry<'_>, motor: u8, group: Group, settings: &MotorSettings) -> Result<Values, Nack> {
    let bytes = value_bytes(entry, motor, group).unwrap_or_default();
    let values = Values::read_over(group, bytes, settings)?;
    values.apply_to(settings).map(|_| values)
}

/// Returns the last entry with a drive base.
fn newest_base(record: &SettingsRecord) -> Option<Entry<'_>> {
    record.entries().filter(|entry| entry.id == BASE).last()
}

/// Reads an address from an entry. `None` if the payload is not a valid address.
fn address_of(entry: &Entry<'_>) -> Option<Address> {
    Address::read(&mut Fields::new(entry.payload)).ok()
}
