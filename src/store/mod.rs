//! Settings that outlast power: what a stored record is, byte by byte, and which of two copies counts.
//!
//! A record is the requests that make a hub's settings what they are, as a host would send them. Nothing of a setting is
//! stated twice, and a record that lacks a setting, or the last fields of one, leaves these as the firmware has them.
//!
//! | bytes | |
//! |---|---|
//! | u8 | [`VERSION`] of the layout |
//! | u32 | number of the save, from 1 |
//! | then, as often as there is something to say: u16 | type of the request, as on hubs of this project |
//! | u8 | length of its payload |
//! | | its payload |
//!
//! What a later firmware adds by new requests, or by new fields at the end of one, is kept on a save by this one, and needs
//! no other version. A record of a later version is not read, and not replaced unless a host asks for it.
//!
//! A save writes two copies, one after the other. Whatever cuts the power or turns a bit, one of them is whole; that they
//! are not the same says that it happened. Where they are kept, `tasks::store` knows.
//!
//! ```
//! use motor_hub::store::{Copies, Record, Stored};
//!
//! let mut record = Record::new(7);
//! record.push(0x7F06, &[5])?; // Set the address to 5.
//!
//! let mut copies = Copies::default();
//! copies.add(Some(record.bytes()));
//! copies.add(None); // Never written, or damaged.
//! let found = copies.found();
//! assert_eq!((found.stored, found.record.number()), (Stored::OneCopy, 7));
//! assert_eq!(found.record.entries().next().map(|entry| entry.id), Some(0x7F06));
//! # Ok::<(), motor_hub::store::Full>(())
//! ```

mod copies;
mod record;

pub use copies::{Copies, Found, Stored};
pub use record::{CAPACITY, Entry, Full, Record, Unreadable, VERSION};

/// What became of the last thing that was to be written or read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Outcome {
    /// There was none since boot.
    #[default]
    None,
    /// It was done.
    Done,
    /// Not written: there is room only after an erasure, for which all motors must be off.
    NeedsErase,
    /// The memory refused.
    Refused,
    /// What was written does not read back.
    Lost,
}

/// Something for whoever has the memory to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Order {
    /// What to write, both copies; `None` to read what is there.
    pub record: Option<Record>,
    /// All is to be erased before, because it makes no sense.
    pub afresh: bool,
    /// Motors are off.
    pub may_erase: bool,
}
