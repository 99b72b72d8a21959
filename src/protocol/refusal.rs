//! Reasons why a hub refuses a request, as numbers and as texts.
//!
//! ```
//! use motor_hub::protocol::Nack;
//!
//! assert_eq!(Nack::BATTERY_LOW.to_string(), "battery unknown, below 7 V, or not at 7.5 V again (NACK 52)");
//! assert_eq!(Nack::parameter(1), Nack(1));
//! ```

use core::fmt;

/// The reason of a refusal, as the number in the protocol. A refused request has changed neither settings nor motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Nack(pub u8);

/// Defines the reasons that this hub uses, with their texts. `others` has the texts of reasons that only other hubs
/// use.
macro_rules! reasons {
    ({ $($name:ident = $code:literal $text:literal,)+ } others { $($other:literal $other_text:literal,)+ }) => {
        impl Nack {
            $(#[doc = concat!("Reason ", stringify!($code), ": ", $text, ".")]
            pub const $name: Self = Self($code);)+

            const fn text(self) -> &'static str {
                match self.0 {
                    $($code => $text,)+
                    $($other => $other_text,)+
                    _ => "a reason that the protocol does not define",
                }
            }
        }
    };
}

reasons! {{
    NO_OUTPUT = 18 "no digital pin is an output",
    NO_INPUT = 28 "no digital pin is an input",
    SERVO_NOT_CONFIGURED = 30 "no pulse width is set for this servo",
    SERVO_BATTERY_LOW = 31 "battery too low for servos",
    I2C_BUSY = 40 "I2C bus busy with a transfer",
    I2C_RUNNING = 41 "I2C transfer still running",
    I2C_NO_TRANSFER = 42 "no I2C transfer since the start of the hub",
    I2C_OTHER_TRANSFER = 43 "the last I2C transfer was of the other kind",
    NOT_CONFIGURED = 50 "no target set for this mode",
    WRONG_MODE = 51 "not possible in the motor's present mode, or the motor is not enabled",
    BATTERY_LOW = 52 "battery unknown, below 7 V, or not at 7.5 V again",
    MOTOR_ENABLED = 60 "a motor is enabled",
    STORE_BUSY = 61 "settings are being stored or read",
    STORE_LATER = 62 "the stored settings are a later firmware's",
    STORE_DAMAGED = 63 "the stored settings are damaged",
    STORE_FULL = 64 "no room for these settings beside those of another firmware",
    UPDATE_BUSY = 70 "new firmware is being written or checked",
    UPDATE_ON_TRIAL = 71 "the firmware that runs has not confirmed itself yet",
    UPDATE_ARMED = 72 "new firmware waits for a restart already",
    UPDATE_TOO_LONG = 73 "the image is longer than the active slot, or shorter than 8 bytes",
    UPDATE_NOT_BEGUN = 74 "no new firmware was announced, or the flash failed",
    UPDATE_GAP = 75 "a chunk is missing before this one",
    UPDATE_NOT_AN_IMAGE = 76 "the image is not for this chip, or not linked to its slot",
    UPDATE_NOT_ARMED = 77 "no new firmware waits for a restart",
    UPDATE_UNSIGNED = 78 "new firmware for this hub must be signed, and is not",
    UPDATE_OTHER_KEY = 79 "the signature is by another key than the hub's",
    UPDATE_NO_SIGNER = 80 "the hub was built without a key, and checks no signatures",
    NOT_MEASURED = 81 "not measured at the moment",
    NO_BASE = 82 "no drive base is configured",
    UNSUPPORTED = 253 "this hub does not have it",
    UNKNOWN = 255 "unknown command",
} others {
    44 "I2C data line stuck",
    45 "I2C clock line stuck",
    46 "I2C timeout",
    254 "known command, not routed",
}}

impl Nack {
    /// Creates the refusal of a parameter that is out of range or missing. `index` is the number of the parameter; the
    /// first parameter has number 0.
    ///
    /// The numbers 10 and above are other reasons. A parameter with a number above 9 is therefore reported as number 9.
    pub const fn parameter(index: u8) -> Self {
        Self(if index > 9 { 9 } else { index })
    }
}

impl fmt::Display for Nack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(code) = *self;
        match code {
            0..=9 => write!(f, "parameter {code} (counted from 0) is out of range"),
            10..=17 => write!(f, "digital pin {} is not an output", code - 10),
            20..=27 => write!(f, "digital pin {} is not an input", code - 20),
            _ => f.write_str(self.text()),
        }?;
        write!(f, " (NACK {code})")
    }
}

impl core::error::Error for Nack {}
