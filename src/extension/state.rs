//! Reports of the stored settings, of a firmware update, and of the board's equipment.

use crate::devices::Equipment;
use crate::protocol::payload::{Text, codes, fields_in_order, payload};
use crate::store::{self, Stored};
use crate::update::{self, Booted, Phase};

codes!(Stored { 0 = Nothing, 1 = Whole, 2 = OneCopy, 3 = Later, 4 = Damaged });
codes!(store::Outcome { 0 = None, 1 = Done, 2 = NeedsErase, 3 = Refused, 4 = Lost });
codes!(Phase { 0 = Nothing, 1 = Receiving, 2 = Checking, 3 = Armed, 4 = Disarming });
codes!(Booted { 0 = Unknown, 1 = Confirmed, 2 = OnTrial, 3 = Reverted, 4 = Unconfirmable });
codes!(update::Outcome { 0 = None, 1 = Done, 2 = Refused, 3 = Mismatch, 4 = WrongSignature, 5 = Older });

fields_in_order!(Equipment { digital, servos, analog, i2c, rail, temperature });

payload! {
    /// State of the stored settings. [`crate::store`] defines its terms.
    #[derive(Copy, Default)]
    pub struct StoreReport {
        /// State of the stored record.
        pub stored: Stored,
        /// Version of the record's format; 0 if no copy of the record has a known version.
        pub version: u8,
        /// Number of the save that wrote the record. The first save has number 1. The number is 0 if no record can be
        /// read.
        pub number: u32,
        /// True while an access to the memory is requested or running.
        pub is_busy: bool,
        /// Result of the last access to the memory. When a host sets an address, the hub stores the address, which is
        /// an access too.
        pub outcome: store::Outcome,
        /// True if settings, address or drive base in force would change at a restart.
        pub differs: bool,
        /// Number of stored entries that this firmware does not know. A save keeps these entries.
        pub unknown: u8,
        /// Number of stored entries that this firmware refuses. The firmware's own settings apply instead.
        pub refused: u8,
        /// Motors whose coefficients are configured. Bit i stands for motor i.
        pub coefficients: u8,
    }
}

payload! {
    /// State of a firmware update. [`crate::update`] defines its terms.
    #[derive(Default)]
    pub struct UpdateReport {
        /// Phase of the update.
        pub phase: Phase,
        /// Result of the last request to the task `tasks::update`.
        pub outcome: update::Outcome,
        /// True while the task `tasks::update` has a request that is not finished.
        pub is_busy: bool,
        /// How the present firmware was started.
        pub booted: Booted,
        /// Number of bytes of the image that were accepted so far.
        pub received: u32,
        /// Announced length of the image in bytes.
        pub length: u32,
        /// Address that images must be linked to.
        pub origin: u32,
        /// Largest length of an image in bytes.
        pub capacity: u32,
        /// Announced version of the image.
        pub version: Text,
    }
}
