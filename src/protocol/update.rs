//! New firmware, as a host sends it: functions of this hub's [own interface](super::setup).
//!
//! | function | payload | answer |
//! |---|---|---|
//! | 21 announce an image | u32, its bytes; u32, its CRC-32 (IEEE 802.3); a length and so many bytes, its version | ACK |
//! | 22 a chunk of it | u32, where it belongs; a length and so many bytes: 96, in the last what is left | ACK: it is being written |
//! | 23 all chunks are sent | | ACK: the image is being checked, and armed |
//! | 24 restart with the image that is armed | | ACK, and within 0.1 s a reset |
//! | 25 abandon the update, an image that is armed too | | ACK |
//! | 26 tell how far the update is | | the fields of an [`UpdateReport`] |
//! | 27 say who signed the image, after 21 | 32 bytes, a public key of Ed25519; 64 bytes, its signature of the image's SHA-512 | ACK |
//!
//! They are refused (253) on a board without a bootloader. 21 and 24 are refused while a motor is enabled (60); all but 26 while
//! the last chunk is being written, its page erased (2 s each 128 kB), or the image checked (70); 21 while the firmware that
//! runs is on trial (71) or an image is armed (72), or if the image is longer than its slot (73); 22 and 23 if nothing was
//! announced, or the flash failed (74), or if a chunk is missing before (75); 22 if the image's vectors do not point into
//! this chip's RAM and the slot (76); 24 if no image is armed (77). A hub that was built with a signer's key refuses the first
//! 22 if there was no 27 (78), and a 27 with another key (79); one without a key, any 27 (80). Whether the signature is one of the
//! image is seen after 23, and told by the report. A chunk that was taken already is acknowledged and
//! changes nothing.
//!
//! Of the report:
//!
//! | field | |
//! |---|---|
//! | u8 | 0 there is no update, 1 chunks are taken, 2 the image is being checked, 3 it is armed, 4 being disarmed |
//! | u8 | what became of the last order: 0 there was none, 1 done, 2 the flash refused, 3 it reads back something else, 4 the signature is not one of this image |
//! | bool | something is being written or checked |
//! | u8 | how the firmware that runs was started: 0 not known yet, 1 it stays, 2 on trial, 3 a newer one failed, this is the one before |
//! | u32, u32 | bytes taken, of how many |
//! | u32, u32 | the address that images are linked to, and the most bytes of one |
//! | length, bytes | version, as announced |
//!
//! ```
//! use motor_hub::protocol::Request;
//! use motor_hub::protocol::fields::Text;
//! use motor_hub::protocol::update::ToUpdate;
//!
//! let request = Request::Update(ToUpdate::Chunk { offset: 96, bytes: Text::new(&[7, 8]).unwrap() });
//! assert_eq!((request.id(), &*request.payload()), (0x4D16, &[96, 0, 0, 0, 2, 7, 8][..]));
//! ```

use super::fields::{Text, codes, in_turn};
use super::table::requests;
use crate::update::{Booted, Outcome, Phase};

requests! {
    /// A request about new firmware.
    pub enum ToUpdate {
        21 Begin { length: u32, crc: u32, version: Text },
        22 Chunk { offset: u32, bytes: Text },
        23 Finish,
        24 Restart,
        25 Abandon,
        /// Answered by an [`UpdateReport`].
        26 State,
        27 Sign { key: [u8; 32], signature: [u8; 64] },
    }
}

codes!(Phase {
    0 = Nothing,
    1 = Receiving,
    2 = Checking,
    3 = Armed,
    4 = Disarming
});

codes!(Booted {
    0 = Unknown,
    1 = Confirmed,
    2 = OnTrial,
    3 = WentBack
});

codes!(Outcome {
    0 = None,
    1 = Done,
    2 = Refused,
    3 = Mismatch,
    4 = WrongSignature
});

/// How far an update is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct UpdateReport {
    /// What is done next.
    pub phase: Phase,
    /// What became of the last order.
    pub outcome: Outcome,
    /// Something is being written or checked.
    pub at_work: bool,
    /// How the firmware that runs was started.
    pub booted: Booted,
    /// Bytes that were taken.
    pub received: u32,
    /// Of so many.
    pub length: u32,
    /// The address that images are linked to.
    pub origin: u32,
    /// The most bytes of an image.
    pub capacity: u32,
    /// Version of the image, as announced.
    pub version: Text,
}

in_turn!(UpdateReport { phase, outcome, at_work, booted, received, length, origin, capacity, version });
