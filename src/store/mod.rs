//! Records of settings that outlast power, byte by byte, and the choice between two copies of a record.
//!
//! A record has entries with the type and the payload of requests that would set the settings. Settings and last fields that a
//! record lacks stay as the firmware has them.
//!
//! | bytes | |
//! |---|---|
//! | u8 | [`VERSION`] of the layout |
//! | u32 | number of the save, from 1 |
//! | then for each entry: u16 | type of the request, as on hubs of this project |
//! | u8 | length of its payload |
//! | | its payload |
//!
//! A later firmware may add entries, and fields at the end of an entry, without a new version; a save by this firmware keeps
//! them. A record of a later version is not read, and only a reset replaces it.
//!
//! A save writes two copies, one after the other. After a power cut or a damaged bit one copy is complete, and the copies
//! differ. `tasks::store` decides where the copies are.
//!
//! ```
//! use motor_hub::store::{Found, Record, Stored};
//!
//! let mut record = Record::new(7);
//! record.push(0x7F06, &[5])?; // Set the address to 5.
//!
//! let mut found = Found::default();
//! found.add(Some(record.bytes()));
//! found.add(None); // Never written, or damaged.
//! assert_eq!((found.stored, found.record.number()), (Stored::OneCopy, 7));
//! assert_eq!(found.record.entries().next().map(|entry| entry.id), Some(0x7F06));
//! # Ok::<(), heapless::CapacityError>(())
//! ```

mod found;
mod record;

pub use found::{Found, Stored};
pub use record::{CAPACITY, Entry, Record, Unreadable, VERSION};

/// Result of the last access to the memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// There was no access since boot.
    #[default]
    None,
    /// The access has succeeded.
    Done,
    /// Nothing was written, because the memory must be erased first, for which all motors must be off.
    NeedsErase,
    /// The memory refused the access.
    Refused,
    /// The written data does not read back.
    Lost,
}

/// An access to the memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoreRequest {
    /// The record to write in two copies; `None` to read the memory.
    pub record: Option<Record>,
    /// True if the memory must be erased first, because its contents are damaged.
    pub afresh: bool,
    /// True if all motors are off, so that the memory may be erased.
    pub may_erase: bool,
}
