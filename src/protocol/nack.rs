//! Why a request is refused.
//!
//! ```
//! use motor_hub::protocol::Nack;
//!
//! assert_eq!(Nack::BATTERY_LOW.to_string(), "battery too low (NACK 52)");
//! assert_eq!(Nack::parameter(1), Nack(1));
//! ```

use super::pins::Pin;
use core::fmt;

/// The reason of a refusal as the protocol numbers it; nothing was changed. Hubs of other makes use
/// more of the numbers than this one, which has names for its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Nack(pub u8);

impl Nack {
    /// No digital pin is an output.
    pub const NO_OUTPUT: Self = Self(18);
    /// No digital pin is an input.
    pub const NO_INPUT: Self = Self(28);
    /// Motor without a target for its mode.
    pub const NOT_CONFIGURED: Self = Self(50);
    /// Not in the motor's present mode.
    pub const WRONG_MODE: Self = Self(51);
    /// The battery is too low to run a motor, or its voltage is not known.
    pub const BATTERY_LOW: Self = Self(52);
    /// While a motor is enabled.
    pub const MOTOR_ENABLED: Self = Self(60);
    /// Settings are being stored or read.
    pub const STORE_AT_WORK: Self = Self(61);
    /// What is stored is a later firmware's.
    pub const STORE_LATER: Self = Self(62);
    /// What is stored makes no sense.
    pub const STORE_DAMAGED: Self = Self(63);
    /// There is no room for these settings beside those of another firmware.
    pub const STORE_FULL: Self = Self(64);
    /// A chunk of new firmware is being written, or the firmware checked.
    pub const UPDATE_AT_WORK: Self = Self(70);
    /// The firmware that runs is on trial.
    pub const UPDATE_ON_TRIAL: Self = Self(71);
    /// New firmware waits for a restart.
    pub const UPDATE_ARMED: Self = Self(72);
    /// New firmware is longer than its slot, or empty.
    pub const UPDATE_TOO_LONG: Self = Self(73);
    /// No new firmware was announced, or the flash failed.
    pub const UPDATE_NOT_BEGUN: Self = Self(74);
    /// A chunk is missing before.
    pub const UPDATE_GAP: Self = Self(75);
    /// What was sent is no firmware for this chip and slot.
    pub const UPDATE_NOT_AN_IMAGE: Self = Self(76);
    /// No new firmware waits for a restart.
    pub const UPDATE_NOT_ARMED: Self = Self(77);
    /// New firmware must be signed, and no signature was sent.
    pub const UPDATE_UNSIGNED: Self = Self(78);
    /// New firmware is signed by another key than the hub's.
    pub const UPDATE_OTHER_KEY: Self = Self(79);
    /// A signature for a hub that was built without a key, and checks none.
    pub const UPDATE_NO_SIGNER: Self = Self(80);
    /// A known command for something that the hub does not have.
    pub const UNSUPPORTED: Self = Self(253);
    /// Not a command.
    pub const UNKNOWN: Self = Self(255);

    /// The payload's parameter with this number is out of range or missing. 10 and above mean other
    /// things, so the tenth and those after it are all called 9.
    pub const fn parameter(index: u8) -> Self {
        Self(if index > 9 { 9 } else { index })
    }
}

impl Nack {
    /// The digital pin is to be set, and is an input.
    pub const fn not_an_output(pin: Pin) -> Self {
        Self(10 + pin.get())
    }

    /// The digital pin is to be read, and is an output.
    pub const fn not_an_input(pin: Pin) -> Self {
        Self(20 + pin.get())
    }
}

impl fmt::Display for Nack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(code) = *self;
        match code {
            0..=9 => write!(f, "parameter {code} (counted from 0) is out of range"),
            10..=17 => write!(f, "digital pin {} is not an output", code - 10),
            18 => f.write_str("no digital pin is an output"),
            20..=27 => write!(f, "digital pin {} is not an input", code - 20),
            28 => f.write_str("no digital pin is an input"),
            30 => f.write_str("servo not configured"),
            31 => f.write_str("battery too low for servos"),
            40 => f.write_str("I2C busy"),
            41 => f.write_str("I2C transfer in progress"),
            42 => f.write_str("no I2C result pending"),
            43 => f.write_str("I2C query does not match the last transfer"),
            44 => f.write_str("I2C data line stuck"),
            45 => f.write_str("I2C clock line stuck"),
            46 => f.write_str("I2C timeout"),
            50 => f.write_str("no target set for this mode"),
            51 => f.write_str("not in the motor's present mode"),
            52 => f.write_str("battery too low"),
            60 => f.write_str("a motor is enabled"),
            61 => f.write_str("settings are being stored or read"),
            62 => f.write_str("what is stored is a later firmware's"),
            63 => f.write_str("what is stored is damaged"),
            64 => f.write_str("no room for these settings beside those of another firmware"),
            70 => f.write_str("new firmware is being written or checked"),
            71 => f.write_str("the firmware that runs has not confirmed itself yet"),
            72 => f.write_str("new firmware waits for a restart already"),
            73 => f.write_str("the image is longer than its slot, or empty"),
            74 => f.write_str("no new firmware was announced, or the flash failed"),
            75 => f.write_str("a chunk is missing before this one"),
            76 => f.write_str("the image is not for this chip, or not linked to its slot"),
            77 => f.write_str("no new firmware waits for a restart"),
            78 => f.write_str("new firmware for this hub must be signed, and is not"),
            79 => f.write_str("the signature is by another key than the hub's"),
            80 => f.write_str("the hub was built without a key, and checks no signatures"),
            253 => f.write_str("this hub does not have it"),
            254 => f.write_str("known command, not routed"),
            255 => f.write_str("unknown command"),
            _ => f.write_str("a reason that the protocol does not know"),
        }?;
        write!(f, " (NACK {code})")
    }
}

impl core::error::Error for Nack {}
