//! One record as bytes.

use heapless::Vec;

/// The layout that this firmware writes.
pub const VERSION: u8 = 1;

/// The most bytes of a record: four motors' settings take 469; the rest is for what a later firmware adds.
pub const CAPACITY: usize = 511;

/// Version and number.
const HEAD: usize = 5;

/// A type and a length.
const ENTRY_HEAD: usize = 3;

/// There is no room for an entry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Full;

impl core::fmt::Display for Full {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "a record has at most {CAPACITY} bytes")
    }
}

impl core::error::Error for Full {}

/// Why bytes are no record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Unreadable {
    /// They are of this later version.
    Later(u8),
    /// They make no sense.
    Damaged,
}

/// A request that is part of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry<'a> {
    /// Its type.
    pub id: u16,
    /// Its fields: those that the firmware knew that wrote it.
    pub payload: &'a [u8],
}

/// A record of this version.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Record {
    /// Always head and whole entries.
    bytes: Vec<u8, CAPACITY>,
}

impl Record {
    /// Without entries: everything as the firmware has it.
    pub fn new(number: u32) -> Self {
        let [a, b, c, d] = number.to_le_bytes();
        Self { bytes: [VERSION, a, b, c, d].into_iter().collect() }
    }

    /// Reads a record of any version up to this one.
    ///
    /// # Errors
    /// Why the bytes are none.
    pub fn read(bytes: &[u8]) -> Result<Self, Unreadable> {
        match bytes.first() {
            None | Some(0) => return Err(Unreadable::Damaged),
            Some(&version) if version > VERSION => return Err(Unreadable::Later(version)),
            // The first: nothing to migrate.
            Some(_) => (),
        }
        let mut rest = bytes.get(HEAD..).ok_or(Unreadable::Damaged)?;
        while !rest.is_empty() {
            (_, rest) = split_entry(rest).ok_or(Unreadable::Damaged)?;
        }
        Ok(Self { bytes: Vec::from_slice(bytes).map_err(|_| Unreadable::Damaged)? })
    }

    /// As it is stored.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Which save it is of, from 1; 0 for nothing that was ever stored.
    pub fn number(&self) -> u32 {
        self.bytes.get(1..HEAD).and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes)
    }

    /// What it says, in its order.
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
    /// If there is no room for all of it; nothing is appended then.
    pub fn push(&mut self, id: u16, payload: &[u8]) -> Result<(), Full> {
        let length = u8::try_from(payload.len()).map_err(|_| Full)?;
        if self.bytes.len() + ENTRY_HEAD + payload.len() > CAPACITY {
            return Err(Full);
        }
        let [low, high] = id.to_le_bytes();
        self.bytes.extend([low, high, length]);
        self.bytes.extend(payload.iter().copied());
        Ok(())
    }
}

/// The first entry, and what follows it; `None` if there is none whole.
fn split_entry(bytes: &[u8]) -> Option<(Entry<'_>, &[u8])> {
    let (&[low, high, length], rest) = bytes.split_first_chunk()?;
    let (payload, rest) = rest.split_at_checked(length.into())?;
    Some((Entry { id: u16::from_le_bytes([low, high]), payload }, rest))
}
