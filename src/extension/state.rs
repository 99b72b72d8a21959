//! State of the stored settings, and of an update of the firmware.

use crate::protocol::payload::{Text, codes, payload};
use crate::store::{self, Stored};
use crate::update::{self, Booted, Phase};

codes!(Stored { 0 = Nothing, 1 = Whole, 2 = OneCopy, 3 = Later, 4 = Damaged });
codes!(store::Outcome { 0 = None, 1 = Done, 2 = NeedsErase, 3 = Refused, 4 = Lost });
codes!(Phase { 0 = Nothing, 1 = Receiving, 2 = Checking, 3 = Armed, 4 = Disarming });
codes!(Booted { 0 = Unknown, 1 = Confirmed, 2 = OnTrial, 3 = WentBack, 4 = Unconfirmable });
codes!(update::Outcome { 0 = None, 1 = Done, 2 = Refused, 3 = Mismatch, 4 = WrongSignature });

payload! {
    /// State of the stored settings.
    #[derive(Copy, Default)]
    pub struct StoreReport {
        /// State of the stored record.
        pub stored: Stored,
        /// Version of the record's layout; 0 without a record.
        pub version: u8,
        /// Number of the save, from 1; 0 without a record.
        pub number: u32,
        /// True while a save, a load or a reset is running.
        pub at_work: bool,
        /// Result of the last save, load or reset.
        pub outcome: store::Outcome,
        /// True if the settings in force differ from the stored settings.
        pub differs: bool,
        /// Stored entries that this firmware does not know. A save keeps them.
        pub unknown: u8,
        /// Stored entries that this firmware refuses. The firmware's own settings apply instead.
        pub refused: u8,
        /// Motors whose coefficients a host has set: bit 0 is motor 0.
        pub coefficients: u8,
    }
}

payload! {
    /// State of an update.
    #[derive(Default)]
    pub struct UpdateReport {
        /// Phase of the update.
        pub phase: Phase,
        /// Result of the last request.
        pub outcome: update::Outcome,
        /// True while the hub writes or checks.
        pub at_work: bool,
        /// How the firmware that runs was started.
        pub booted: Booted,
        /// Bytes received.
        pub received: u32,
        /// Bytes of the announced image.
        pub length: u32,
        /// Address that images are linked to.
        pub origin: u32,
        /// The most bytes of an image.
        pub capacity: u32,
        /// Version of the image, as announced.
        pub version: Text,
    }
}
