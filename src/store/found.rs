//! The choice between two copies of a record.

use super::record::{SettingsRecord, VERSION, later_version};

/// State of the stored record, from both copies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum Stored {
    /// No save was completed since the memory was erased, and no copy can be read.
    #[default]
    Nothing,
    /// Both copies hold the same record.
    Whole,
    /// One copy holds the record. The other copy is damaged, missing or older. Causes are a power cut during the last
    /// save, and a worn memory.
    OneCopy,
    /// There is a record of a later version, in one copy or in both. This firmware cannot read the record, and a save
    /// does not overwrite it.
    Later,
    /// No copy can be read, although a save was completed, or although a copy has a right checksum. Also the state if
    /// the memory reports an error.
    Damaged,
}

/// Contents of the memory. To find out the contents, [`add`](Self::add) is called with each of the two copies.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// State of the record.
    pub stored: Stored,
    /// Version of the record, also of a later one. 0 if no copy has a known version.
    pub version: u8,
    /// The newer copy. A record without entries, with number 0, if no copy can be read or one copy has a later version.
    pub record: SettingsRecord,
}

impl Found {
    /// Creates contents in this state, without a record that can be read.
    pub fn without_record(stored: Stored, version: u8) -> Self {
        Self { stored, version, record: SettingsRecord::new(0) }
    }

    /// Adds the bytes of a copy. `copy` is `None` if the copy is missing or its checksum is wrong.
    ///
    /// If one copy has a later version, the state is [`Stored::Later`], whatever the other copy is.
    pub fn add(&mut self, copy: Option<&[u8]>) {
        let Some(copy) = copy else { return };
        if let Some(version) = later_version(copy) {
            *self = Self::without_record(Stored::Later, version.max(self.version));
            return;
        }
        let has_record = matches!(self.stored, Stored::Whole | Stored::OneCopy);
        match SettingsRecord::read(copy) {
            _ if self.stored == Stored::Later => (),
            None if has_record => (),
            None => self.stored = Stored::Damaged,
            Some(record) if has_record && record == self.record => self.stored = Stored::Whole,
            Some(record) if has_record && record.number() < self.record.number() => (),
            Some(record) => *self = Self { stored: Stored::OneCopy, version: VERSION, record },
        }
    }
}

impl Default for Found {
    /// Creates the contents before the first copy is added.
    fn default() -> Self {
        Self::without_record(Stored::Nothing, 0)
    }
}
