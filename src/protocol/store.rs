//! Settings that outlast power, as a host asks for them: functions of this hub's [own interface](super::setup).
//!
//! | function | payload | answer |
//! |---|---|---|
//! | 14 save the settings in force | | ACK: they are being saved |
//! | 15 put in force what is stored | | ACK: it is being read |
//! | 16 put in force, and store, what the firmware has | | ACK: it is being stored |
//! | 17 tell what is stored | | the fields of a [`StoreReport`] |
//!
//! The first three end later, up to some seconds if the memory must be erased for it, and function 17 tells how. They are
//! refused on a board that stores nothing (253), while one of them is at work (61), 15 and 16 while a motor is enabled (60),
//! 14 when what is stored is a later firmware's (62) or makes no sense (63): 16 clears that. 14 is done while motors
//! run, unless it needs an erasure, which function 17 then says.
//!
//! Stored are address, set-up, motion, protection and timing of each motor, its mode, its current alert, and the
//! coefficients that a host gave. Nothing is written unasked, but for the address: as on hubs of REV, who sets it stores
//! it. It is read at boot only: 15 and 16 leave the address that a host talks to.
//!
//! | field | |
//! |---|---|
//! | u8 | stored: 0 nothing, 1 settings, 2 settings of which the second copy is damaged or older, 3 a later firmware's, 4 what makes no sense |
//! | u8 | version of its layout, 0 if it has none |
//! | u32 | number of the save, from 1; 0 if there is none |
//! | bool | one of the first three is at work |
//! | u8 | what became of the last one: 0 there was none, 1 it was done, 2 an erasure is needed, for which all motors must be off, 3 the memory refused, 4 what was written does not read back |
//! | bool | the settings in force are others than those stored |
//! | u8 | entries that this firmware does not know, which are kept |
//! | u8 | entries that it does not take: their settings are the firmware's |
//! | u8 | motors for which a host gave coefficients, which are stored then: bit 0 is motor 0 |
//!
//! ```
//! use motor_hub::protocol::Request;
//! use motor_hub::protocol::store::ToStore;
//!
//! let request = Request::Store(ToStore::Save);
//! assert_eq!((request.id(), request.payload().len()), (0x4D0E, 0));
//! ```

use super::fields::{codes, in_turn};
use super::table::requests;
use crate::store::{Outcome, Stored};

requests! {
    /// A request to where settings are stored.
    pub enum ToStore {
        14 Save,
        15 Load,
        16 Reset,
        /// Answered by a [`StoreReport`].
        17 State,
    }
}

codes!(Stored {
    0 = Nothing,
    1 = Whole,
    2 = OneCopy,
    3 = Later,
    4 = Damaged
});

codes!(Outcome {
    0 = None,
    1 = Done,
    2 = NeedsErase,
    3 = Refused,
    4 = Lost
});

/// What is stored, and what is being done about it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StoreReport {
    /// How what is stored is.
    pub stored: Stored,
    /// The version of its layout; 0 if it has none.
    pub version: u8,
    /// How often something was saved.
    pub number: u32,
    /// Something is being written or read.
    pub at_work: bool,
    /// What became of the last thing that was to be.
    pub outcome: Outcome,
    /// The settings in force are others than those stored.
    pub differs: bool,
    /// Entries that this firmware does not know.
    pub unknown: u8,
    /// Entries that it does not take.
    pub refused: u8,
    /// Bit 0 is motor 0: a host gave it coefficients, by which it is regulated.
    pub coefficients: u8,
}

in_turn!(StoreReport { stored, version, number, at_work, outcome, differs, unknown, refused, coefficients });
