//! A record as bytes.

use heapless::{CapacityError, Vec};

/// The layout that this firmware writes.
pub const VERSION: u8 = 1;

/// The most bytes of a record. The settings of four motors take 469 bytes; a later firmware may add the rest.
pub const CAPACITY: usize = 511;

/// Bytes of version and number.
const HEAD: usize = 5;

/// Bytes of an entry's type and length.
const ENTRY_HEAD: usize = 3;

/// Why bytes are not read as a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Unreadable {
    /// The bytes are a record of this later version.
    Later(u8),
    /// The bytes are damaged.
    Damaged,
}

/// An entry of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'a> {
    /// Type of the request.
    pub id: u16,
    /// Fields of the request, as the firmware that wrote the record knew them.
    pub payload: &'a [u8],
}

/// A record of this version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Head and complete entries.
    bytes: Vec<u8, CAPACITY>,
}

impl Record {
    /// A record without entries, with which all settings are the firmware's.
    pub fn new(number: u32) -> Self {
        let [a, b, c, d] = number.to_le_bytes();
        Self { bytes: [VERSION, a, b, c, d].into_iter().collect() }
    }

    /// Reads a record of any version up to this one.
    ///
    /// # Errors
    /// The reason why the bytes are no record of this version.
    pub fn read(bytes: &[u8]) -> Result<Self, Unreadable> {
        match bytes.first() {
            None | Some(0) => return Err(Unreadable::Damaged),
            Some(&version) if version > VERSION => return Err(Unreadable::Later(version)),
            // This is the first version.
            Some(_) => (),
        }
        let mut rest = bytes.get(HEAD..).ok_or(Unreadable::Damaged)?;
        while !rest.is_empty() {
            (_, rest) = split_entry(rest).ok_or(Unreadable::Damaged)?;
        }
        Ok(Self { bytes: Vec::from_slice(bytes).map_err(|_| Unreadable::Damaged)? })
    }

    /// The stored bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Number of the save, from 1; 0 for a record that was never stored.
    pub fn number(&self) -> u32 {
        self.bytes.get(1..HEAD).and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes)
    }

    /// The entries in their order.
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
    /// If there is no room for the whole entry; nothing is appended then.
    pub fn push(&mut self, id: u16, payload: &[u8]) -> Result<(), CapacityError> {
        let length = u8::try_from(payload.len()).map_err(|_| CapacityError::default())?;
        if self.bytes.len() + ENTRY_HEAD + payload.len() > CAPACITY {
            return Err(CapacityError::default());
        }
        let [low, high] = id.to_le_bytes();
        self.bytes.extend([low, high, length]);
        self.bytes.extend(payload.iter().copied());
        Ok(())
    }
}

/// The first entry, and the bytes behind it; `None` if the entry is not complete.
fn split_entry(bytes: &[u8]) -> Option<(Entry<'_>, &[u8])> {
    let (&[low, high, length], rest) = bytes.split_first_chunk()?;
    let (payload, rest) = rest.split_at_checked(length.into())?;
    Some((Entry { id: u16::from_le_bytes([low, high]), payload }, rest))
}
