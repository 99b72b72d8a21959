//! Answers with parts of the record of faults and resets. [`crate::record`] defines the terms.

use super::report::battery;
use crate::bridge::Drive;
use crate::protocol::Nack;
use crate::protocol::payload::{Field, Fields, Payload, codec, fields_in_order, payload};
use crate::record::{Fault, Head, NO_MOTOR, Record, Tick, drive_bits, drive_of};
use heapless::Vec;

/// Largest number of entries in an answer.
const ENTRIES: usize = 3;

/// Largest number of ticks in an answer.
const TICKS: usize = 8;

payload! {
    /// Up to three entries of the record.
    #[derive(Default)]
    pub struct Entries {
        /// Number of the present run. 0 for a hub without a record.
        pub run: u32,
        /// Number of entries in the whole record.
        pub count: u8,
        /// The heads of the entries, newest first.
        pub heads: Vec<Head, ENTRIES> as rest,
    }
}

impl Entries {
    /// Reads entries from the record, newest first. The newest `from` entries are left out.
    pub fn of(record: &Record<'_>, from: u8) -> Self {
        let heads = || record.heads();
        Self {
            run: record.run(),
            count: heads().count() as u8,
            heads: heads().skip(from.into()).take(ENTRIES).collect(),
        }
    }
}

payload! {
    /// Up to eight control ticks of an entry.
    #[derive(Default)]
    pub struct Ticks {
        /// Number of all ticks of the entry.
        pub count: u8,
        /// The ticks, oldest first.
        pub ticks: Vec<Tick, TICKS> as rest,
    }
}

impl Ticks {
    /// Reads ticks of the entry with this number, oldest first. The oldest `from` ticks are left out. `None` if the
    /// record has no ticks of this entry.
    pub fn of(record: &Record<'_>, number: u16, from: u8) -> Option<Self> {
        let ticks = record.ticks(number)?;
        Some(Self { count: ticks.len() as u8, ticks: ticks.skip(from.into()).take(TICKS).collect() })
    }
}

/// Codec of a list of values that ends with the payload, or when the vector is full.
mod rest {
    use super::{Field, Fields, Nack, Payload, Vec};

    pub(super) fn read<T: Field, const N: usize>(fields: &mut Fields<'_>) -> Result<Vec<T, N>, Nack> {
        let mut all = Vec::new();
        while !fields.is_empty() && !all.is_full() {
            let _ = all.push(T::read(fields)?);
        }
        Ok(all)
    }

    pub(super) fn write<T: Field>(all: &[T], payload: &mut Payload) {
        all.iter().for_each(|one| one.write(payload));
    }
}

impl Field for Fault {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        fields.checked(Self::from_number)
    }

    fn write(&self, payload: &mut Payload) {
        self.number().write(payload);
    }
}

codec! {
    /// Codec of an optional motor. [`NO_MOTOR`] stands for `None`.
    motor: Option<u8> as u8, |motor| (motor != NO_MOTOR).then_some(motor), |motor| motor.unwrap_or(NO_MOTOR)
}

codec! {
    /// Codec of a command to a bridge in 16 bits, see [`drive_bits`].
    drive: Drive as u16, drive_of, drive_bits
}

fields_in_order!(Head {
    number,
    fault,
    times,
    run,
    uptime_ms,
    battery: battery,
    motor: motor,
    drive: drive,
    detail,
    ticks
});

fields_in_order!(Tick { position, velocity, millivolts, drive: drive });
