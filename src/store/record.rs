//! A record of settings as bytes. The documentation of [`crate::store`] states the format.

use heapless::{CapacityError, Vec};

/// Version of the format that this firmware writes and reads.
pub const VERSION: u8 = 1;

/// Largest size of a record in bytes. All settings of four motors and of a drive base take 515 bytes. With its key of
/// one byte a record of this size fills 17 of the longest words that a flash writes, 32 bytes each.
pub const CAPACITY: usize = 543;

/// Size of the record's version and number in bytes.
const HEAD: usize = 5;

/// Size of an entry's type and length in bytes.
const ENTRY_HEAD: usize = 3;

/// An entry of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'a> {
    /// Packet type of the request.
    pub id: u16,
    /// Payload of the request, with the fields that were known to the firmware that wrote the record.
    pub payload: &'a [u8],
}

/// A record of settings, of version [`VERSION`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SettingsRecord {
    /// Version, number and complete entries.
    bytes: Vec<u8, CAPACITY>,
}

impl SettingsRecord {
    /// Creates a record without entries. `number` is the number of the save.
    pub fn new(number: u32) -> Self {
        let [a, b, c, d] = number.to_le_bytes();
        Self { bytes: [VERSION, a, b, c, d].into_iter().collect() }
    }

    /// Reads a record of version [`VERSION`], which is the first version. `None` for a later version, and for damaged
    /// bytes.
    pub fn read(bytes: &[u8]) -> Option<Self> {
        if bytes.first() != Some(&VERSION) {
            return None;
        }
        let mut rest = bytes.get(HEAD..)?;
        while !rest.is_empty() {
            (_, rest) = split_entry(rest)?;
        }
        Vec::from_slice(bytes).ok().map(|bytes| Self { bytes })
    }

    /// Returns the record as bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Returns the number of the save that wrote the record, from 1. 0 if the record stands for an empty memory.
    pub fn number(&self) -> u32 {
        self.bytes.get(1..HEAD).and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes)
    }

    /// Iterates over the entries in their order.
    pub fn entries(&self) -> impl Iterator<Item = Entry<'_>> {
        let mut rest = self.bytes.get(HEAD..).unwrap_or_default();
        core::iter::from_fn(move || {
            let (entry, after) = split_entry(rest)?;
            rest = after;
            Some(entry)
        })
    }

    /// Appends an entry.
    ///
    /// # Errors
    /// Returns [`CapacityError`] if there is no room for the whole entry. The record does not change then.
    pub fn push(&mut self, id: u16, payload: &[u8]) -> Result<(), CapacityError> {
        self.push_over(id, payload, &[])
    }

    /// Appends an entry with these fields. If the payload of an older entry has more fields at its end, which a later
    /// firmware has stored, these fields are copied too.
    ///
    /// # Errors
    /// See [`push`](Self::push).
    pub fn push_over(&mut self, id: u16, fields: &[u8], older: &[u8]) -> Result<(), CapacityError> {
        let more = older.get(fields.len()..).unwrap_or_default();
        let length = fields.len() + more.len();
        if self.bytes.len() + ENTRY_HEAD + length > CAPACITY {
            return Err(CapacityError::default());
        }
        let ([low, high], length) =
            (id.to_le_bytes(), u8::try_from(length).map_err(|_| CapacityError::default())?);
        self.bytes.extend_from_slice(&[low, high, length])?;
        self.bytes.extend_from_slice(fields)?;
        self.bytes.extend_from_slice(more)
    }
}

/// Returns the version of a record, if it is later than [`VERSION`].
pub(super) fn later_version(bytes: &[u8]) -> Option<u8> {
    bytes.first().copied().filter(|version| *version > VERSION)
}

/// Splits bytes into the first entry and the rest. `None` if the first entry is not complete.
fn split_entry(bytes: &[u8]) -> Option<(Entry<'_>, &[u8])> {
    let (&[low, high, length], rest) = bytes.split_first_chunk()?;
    let (payload, rest) = rest.split_at_checked(length.into())?;
    Some((Entry { id: u16::from_le_bytes([low, high]), payload }, rest))
}
