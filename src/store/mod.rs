//! The stored format of settings, and the choice between two stored copies. The *memory* keeps settings without power.
//!
//! A *record* has entries. An entry has the type and the payload of a request that sets some settings. Settings without
//! an entry have the values that the firmware was built with. If the payload of an entry lacks fields at its end, the
//! settings of these fields have the firmware's values too.
//!
//! | type | content of a record |
//! |---|---|
//! | u8 | [`VERSION`] of the format |
//! | u32 | number of the save that wrote the record, from 1 |
//! | u16 | first entry: packet type of the request, on hubs of this project |
//! | u8 | first entry: length of the payload |
//! | bytes | first entry: payload |
//! | | the other entries |
//!
//! A later firmware may add entries, and fields at the end of an entry, without a new version. This firmware does not
//! know these additions, but its saves keep them. A record of a later version is neither read nor overwritten by a
//! save. Only a *reset of the settings*, which writes a record without entries, replaces a record of a later version.
//!
//! A save writes two copies of the record, one after the other. A power cut or a damaged bit affects at most one copy.
//! `tasks::store` decides where the copies are. The states of the stored record are:
//!
//! ```text
//! Nothing ── first save ──▶ Whole ── power cut in a save, or a damaged copy ──▶ OneCopy ── no copy readable ─▶ Damaged
//!                             ▲                                                    │                               │
//!                             └────────────────────── next save ───────────────────┴──── reset of the settings ────┘
//! ```
//!
//! A copy with a wrong checksum counts as missing. If no copy of the last save is left, the memory may still hold the
//! copies of an older save, which are then found. Otherwise the state is `Damaged` if a save was completed before, and
//! `Nothing` if a power cut has interrupted the first save. The state is also `Damaged` if a copy with a right checksum
//! is no record, or if the memory reports an error. The memory knows that a save was completed by a mark, which is
//! stored after the copies. Earlier firmware stored no mark: without a mark the state is `Nothing` until the next save.
//!
//! A fifth state, `Later`, is reached only if later firmware has written the record. It ends with a reset of the
//! settings.
//!
//! ```
//! use motor_hub::store::{Found, SettingsRecord, Stored};
//!
//! let mut record = SettingsRecord::new(7);
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
pub use record::{CAPACITY, Entry, SettingsRecord, VERSION};

/// Result of the last access to the memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "kebab-case"))]
pub enum Outcome {
    /// There was no access since boot, except for the reading at boot.
    #[default]
    None,
    /// The access has succeeded.
    Done,
    /// The access has not succeeded, because a part of the memory must be erased first. All motors must be off for an
    /// erasure.
    NeedsErase,
    /// The memory has reported an error, or the record has no room for what is to be stored.
    Refused,
    /// The memory does not read back the written record in both copies.
    Lost,
}

/// A request for an access to the memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoreRequest {
    /// The record to write in two copies. `None` if the memory is only to be read.
    pub record: Option<SettingsRecord>,
    /// True if the memory must be erased before the record is written, because its contents are damaged.
    pub erase_first: bool,
    /// True if all motors are off, so that the memory may be erased.
    pub may_erase: bool,
}

/// Result of a [`StoreRequest`]. At boot the task sends a first result without a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoreResult {
    /// Contents of the memory after the request. `None` if the contents cannot be read until all motors are off. The
    /// contents are then unchanged.
    pub found: Option<Found>,
    /// How the request ended.
    pub outcome: Outcome,
}
