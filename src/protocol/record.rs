//! What happened: functions of this hub's [own interface](super::setup), for which the protocol has no words. A hub that
//! is asked by a host that does not know of it never meets them.
//!
//! | function | payload | answer |
//! |---|---|---|
//! | 18 tell what is on [record](crate::record) | u8, how many entries to pass over; bool, forget all of them after this answer | the fields of [`Entries`] |
//! | 19 tell the ticks of one | u16, the entry's number; u8, how many ticks to pass over | the fields of [`Ticks`] |
//!
//! Function 19 is refused (0) if there is no such entry, or no more ticks of it.
//!
//! Of entries:
//!
//! | field | |
//! |---|---|
//! | u32 | which run this is since the record began, from 1; 0 of a hub that keeps none |
//! | u8 | how many entries there are, and then three of them at most, newest first |
//! | u16, u8, u8 | of each: its number, its [fault](Fault), how often in a row |
//! | u16, u32 | in which run, and how long that had lasted, ms |
//! | u16 | battery, mV; 0 if it was unknown |
//! | u8, u16 | motor, 255 for none; what its bridge was told last before: bits 14 and 15 the mode (0 is 5/0, 1 is 9/8, 2 is 6/2), the others the duty in steps of 2^-13 |
//! | u32, u32 | details |
//! | u8 | ticks that are kept |
//!
//! Of ticks:
//!
//! | field | |
//! |---|---|
//! | u8 | how many there are, and then eight of them at most, oldest first |
//! | u16, i16 | of each: the lower 16 bits of the position, counts; speed, counts/s |
//! | i16, u16 | control value; what the bridge was told, as above |
//!
//! ```
//! use motor_hub::protocol::Request;
//! use motor_hub::protocol::record::ToRecord;
//!
//! let request = Request::from(ToRecord::Ticks { number: 0x0203, from: 8 });
//! assert_eq!((request.id(), &*request.payload()), (0x4D13, &[3, 2, 8][..]));
//! ```

use super::fields::{Field, Fields, Payload};
use super::nack::Nack;
use super::table::requests;
use crate::record::{Fault, Head, NOBODY, Record, Tick, drive_bits, drive_of};
use crate::units::{Control, Millivolts};
use heapless::Vec;

/// Entries and ticks that an answer has room for.
const ENTRIES: usize = 3;
const TICKS: usize = 8;

requests! {
    /// About the record.
    pub enum ToRecord {
        /// Answered by [`Entries`].
        18 Entries { from: u8, clear: bool },
        /// Answered by [`Ticks`].
        19 Ticks { number: u16, from: u8 },
    }
}

/// What is on record.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Entries {
    /// Which run this is since the record began, from 1; 0 of a hub that keeps none.
    pub run: u32,
    /// How many entries there are.
    pub count: u8,
    /// Some of them, newest first.
    pub heads: Vec<Head, ENTRIES>,
}

impl Entries {
    /// Those after so many.
    pub fn of(record: &Record<'_>, from: u8) -> Self {
        let heads = || record.heads();
        Self {
            run: record.run(),
            count: heads().count() as u8,
            heads: heads().skip(from.into()).take(ENTRIES).collect(),
        }
    }
}

impl Field for Entries {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        let (run, count) = (u32::read(fields)?, u8::read(fields)?);
        Ok(Self { run, count, heads: rest(fields)? })
    }

    fn write(&self, payload: &mut Payload) {
        self.run.write(payload);
        self.count.write(payload);
        self.heads.iter().for_each(|head| head.write(payload));
    }
}

/// Ticks of an entry.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Ticks {
    /// How many there are.
    pub count: u8,
    /// Some of them, oldest first.
    pub ticks: Vec<Tick, TICKS>,
}

impl Ticks {
    /// Those after so many; `None` if there is no such entry, or no more ticks of it.
    pub fn of(record: &Record<'_>, number: u16, from: u8) -> Option<Self> {
        let ticks = record.ticks(number)?;
        Some(Self { count: ticks.len() as u8, ticks: ticks.skip(from.into()).take(TICKS).collect() })
    }
}

impl Field for Ticks {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(Self { count: u8::read(fields)?, ticks: rest(fields)? })
    }

    fn write(&self, payload: &mut Payload) {
        self.count.write(payload);
        self.ticks.iter().for_each(|tick| tick.write(payload));
    }
}

/// As many as follow, and as there is room for.
fn rest<T: Field, const N: usize>(fields: &mut Fields<'_>) -> Result<Vec<T, N>, Nack> {
    let mut all = Vec::new();
    while !fields.is_empty() && !all.is_full() {
        let _ = all.push(T::read(fields)?);
    }
    Ok(all)
}

impl Field for Fault {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        fields.checked(Self::from_number)
    }

    fn write(&self, payload: &mut Payload) {
        self.number().write(payload);
    }
}

impl Field for Head {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(Self {
            number: u16::read(fields)?,
            fault: Fault::read(fields)?,
            times: u8::read(fields)?,
            run: u16::read(fields)?,
            uptime_ms: u32::read(fields)?,
            battery: Some(Millivolts::new(u16::read(fields)?)).filter(|known| known.get() != 0),
            motor: Some(u8::read(fields)?).filter(|motor| *motor != NOBODY),
            drive: drive_of(u16::read(fields)?),
            detail: Field::read(fields)?,
            ticks: u8::read(fields)?,
        })
    }

    fn write(&self, payload: &mut Payload) {
        self.number.write(payload);
        self.fault.write(payload);
        self.times.write(payload);
        self.run.write(payload);
        self.uptime_ms.write(payload);
        self.battery.map_or(0, Millivolts::get).write(payload);
        self.motor.unwrap_or(NOBODY).write(payload);
        drive_bits(self.drive).write(payload);
        self.detail.write(payload);
        self.ticks.write(payload);
    }
}

impl Field for Tick {
    fn read(fields: &mut Fields<'_>) -> Result<Self, Nack> {
        Ok(Self {
            position: u16::read(fields)?,
            velocity: i16::read(fields)?,
            control: Control::read(fields)?,
            drive: drive_of(u16::read(fields)?),
        })
    }

    fn write(&self, payload: &mut Payload) {
        self.position.write(payload);
        self.velocity.write(payload);
        self.control.write(payload);
        drive_bits(self.drive).write(payload);
    }
}
