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

/// Contents of the memory.
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
}

/// Copies of a record, added one after the other.
#[derive(Clone, Debug)]
pub struct Copies {
    newest: Record,
    /// Number of copies that equal the newest record.
    same: u8,
    /// The latest version above that of this firmware; 0 without one.
    later: u8,
    damaged: bool,
}

impl Default for Copies {
    /// No copies.
    fn default() -> Self {
        Self { newest: Record::new(0), same: 0, later: 0, damaged: false }
    }
}

impl Copies {
    /// Adds the bytes of a copy; `None` if the copy is missing or its checksum is wrong.
    pub fn add(&mut self, copy: Option<&[u8]>) {
        match copy.map(Record::read) {
            None => (),
            Some(Err(Unreadable::Later(version))) => self.later = self.later.max(version),
            Some(Err(Unreadable::Damaged)) => self.damaged = true,
            Some(Ok(record)) if self.same > 0 && record == self.newest => self.same += 1,
            Some(Ok(record)) if self.same > 0 && record.number() < self.newest.number() => (),
            Some(Ok(record)) => (self.newest, self.same) = (record, 1),
        }
    }

    /// The result of all added copies.
    pub fn found(self) -> Found {
        let Self { newest: record, same, later, damaged } = self;
        match (later, same) {
            (1.., _) => Found::without_record(Stored::Later, later),
            (0, 2..) => Found { stored: Stored::Whole, version: VERSION, record },
            (0, 1) => Found { stored: Stored::OneCopy, version: VERSION, record },
            (0, 0) if damaged => Found::without_record(Stored::Damaged, 0),
            (0, 0) => Found::without_record(Stored::Nothing, 0),
        }
    }
}
