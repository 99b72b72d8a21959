//! What two copies amount to.

use super::record::{Record, Unreadable, VERSION};

/// How what is stored is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stored {
    /// There is nothing.
    #[default]
    Nothing,
    /// A record, in two copies that are the same.
    Whole,
    /// A record whose other copy is damaged, missing, or of an earlier save: power went during the last one, or the memory
    /// is worn.
    OneCopy,
    /// A later firmware's, which is kept, and not read.
    Later,
    /// Something that makes no sense.
    Damaged,
}

/// What was found where settings are stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// How it is.
    pub stored: Stored,
    /// Of which version; 0 if that is not known, or nothing is there.
    pub version: u8,
    /// The newer copy; of save 0 and empty if there is none that can be read.
    pub record: Record,
}

impl Found {
    /// Without a record.
    pub fn without_record(stored: Stored, version: u8) -> Self {
        Self { stored, version, record: Record::new(0) }
    }
}

/// Copies, one after the other.
#[derive(Clone, Debug)]
pub struct Copies {
    newest: Record,
    /// Copies of that.
    same: u8,
    /// One is of this later version; 0 if none is.
    later: u8,
    damaged: bool,
}

impl Default for Copies {
    /// None yet.
    fn default() -> Self {
        Self { newest: Record::new(0), same: 0, later: 0, damaged: false }
    }
}

impl Copies {
    /// Takes the bytes of the next copy; `None` if there are none, or none that pass their checksum.
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

    /// What the two amount to.
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
