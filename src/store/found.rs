//! The choice between two copies of a record.

use super::record::{Record, Unreadable, VERSION};

/// State of the stored record.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stored {
    /// There is no record.
    #[default]
    Nothing,
    /// There is a record, and both copies are equal.
    Whole,
    /// There is a record whose other copy is damaged, missing or older: a power cut during the last save, or a worn memory.
    OneCopy,
    /// There is a record of a later version, which is kept and not read.
    Later,
    /// The memory's contents are damaged.
    Damaged,
}

/// Contents of the memory, from the copies that were added one after the other.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// State of the record.
    pub stored: Stored,
    /// Version of the record; 0 without a record.
    pub version: u8,
    /// The newer copy; an empty record with number 0 if no copy can be read.
    pub record: Record,
}

impl Found {
    /// Contents without a record.
    pub fn without_record(stored: Stored, version: u8) -> Self {
        Self { stored, version, record: Record::new(0) }
    }

    /// Adds the bytes of a copy; `None` if the copy is missing or its checksum is wrong. A record of a later version counts
    /// more than any record that this firmware can read.
    pub fn add(&mut self, copy: Option<&[u8]>) {
        let has_record = matches!(self.stored, Stored::Whole | Stored::OneCopy);
        match copy.map(Record::read) {
            None => (),
            Some(Err(Unreadable::Later(version))) => {
                *self = Self::without_record(Stored::Later, version.max(self.version));
            }
            _ if self.stored == Stored::Later => (),
            Some(Err(Unreadable::Damaged)) if has_record => (),
            Some(Err(Unreadable::Damaged)) => self.stored = Stored::Damaged,
            Some(Ok(record)) if has_record && record == self.record => self.stored = Stored::Whole,
            Some(Ok(record)) if has_record && record.number() < self.record.number() => (),
            Some(Ok(record)) => *self = Self { stored: Stored::OneCopy, version: VERSION, record },
        }
    }
}

impl Default for Found {
    /// Contents without a copy.
    fn default() -> Self {
        Self::without_record(Stored::Nothing, 0)
    }
}
