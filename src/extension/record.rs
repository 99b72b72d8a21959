//! The record of faults and resets, as a host reads it in parts.

use super::report::battery;
use crate::bridge::Drive;
use crate::protocol::Nack;
use crate::protocol::payload::{Field, Fields, Payload, in_turn, payload};
use crate::record::{Fault, Head, NOBODY, Record, Tick, drive_bits, drive_of};
use heapless::Vec;

/// The most entries of an answer.
const ENTRIES: usize = 3;

/// The most ticks of an answer.
const TICKS: usize = 8;

payload! {
    /// Entries of the record.
    #[derive(Default)]
    pub struct Entries {
        /// Number of the present run since the record began, from 1; 0 for a hub without a record.
        pub run: u32,
        /// Number of entries in the record.
        pub count: u8,
        /// Up to three entries, newest first.
        pub heads: Vec<Head, ENTRIES> as rest,
    }
}

impl Entries {
    /// The entries of the record behind the first `from` entries.
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
    /// Control ticks of an entry.
    #[derive(Default)]
    pub struct Ticks {
        /// Number of ticks of the entry.
        pub count: u8,
        /// Up to eight ticks, oldest first.
        pub ticks: Vec<Tick, TICKS> as rest,
    }
}

impl Ticks {
    /// The ticks of the entry with this number, behind the first `from` ticks; `None` if there is no such entry.
    pub fn of(record: &Record<'_>, number: u16, from: u8) -> Option<Self> {
        let ticks = record.ticks(number)?;
        Some(Self { count: ticks.len() as u8, ticks: ticks.skip(from.into()).take(TICKS).collect() })
    }
}

/// All values to the end of the payload, as many as the vector has room for.
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

/// A motor, where [`NOBODY`] is none.
mod motor {
    use super::{Field, Fields, NOBODY, Nack, Payload};

    pub(super) fn read(fields: &mut Fields<'_>) -> Result<Option<u8>, Nack> {
        Ok(Some(u8::read(fields)?).filter(|motor| *motor != NOBODY))
    }

    pub(super) fn write(motor: &Option<u8>, payload: &mut Payload) {
        motor.unwrap_or(NOBODY).write(payload);
    }
}

/// The command of a bridge in 16 bits.
mod drive {
    use super::{Drive, Field, Fields, Nack, Payload, drive_bits, drive_of};

    pub(super) fn read(fields: &mut Fields<'_>) -> Result<Drive, Nack> {
        u16::read(fields).map(drive_of)
    }

    pub(super) fn write(drive: &Drive, payload: &mut Payload) {
        drive_bits(*drive).write(payload);
    }
}

in_turn!(Head {
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

in_turn!(Tick { position, velocity, control, drive: drive });
