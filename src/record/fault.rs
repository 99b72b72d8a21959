//! All faults and their numbers. Record, link, logs and `docs/reference/fault-numbers.md` use these numbers.

use crate::motor::EncoderFault;
use crate::motor::Faults;

/// Defines all faults. Each line has the number, the fault, and its name for users. A fault of a motor also has its
/// word in JSON documents, and the field of [`Faults`] with the value that means the fault.
macro_rules! faults {
    ($($number:literal $fault:ident $name:literal $($word:literal $field:ident == $value:expr)?,)+) => {
        /// A fault, or the cause of a reset. `docs/reference/fault-numbers.md` has a section for each.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        #[expect(missing_docs, reason = "each is named below, and explained in docs/reference/fault-numbers.md")]
        pub enum Fault {
            $($fault = $number,)+
        }

        impl Fault {
            /// All faults, in the order of their numbers.
            pub const ALL: &[Self] = &[$(Self::$fault),+];

            /// Returns the fault with this number, or `None` if no fault has this number.
            pub const fn from_number(number: u8) -> Option<Self> {
                match number {
                    $($number => Some(Self::$fault),)+
                    _ => None,
                }
            }

            /// Returns a short name for users.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$fault => $name,)+
                }
            }

            /// Returns the word for a fault of a motor in documents for programs, such as `encoder_stale`. `None` for a
            /// fault of the hub.
            pub const fn word(self) -> Option<&'static str> {
                match self {
                    $($(Self::$fault => Some($word),)?)+
                    _ => None,
                }
            }

            /// Returns the faults of a motor as bits. Bit n stands for the fault with the number n.
            pub(super) fn bits_of(faults: Faults) -> u8 {
                0 $($(| u8::from(faults.$field == $value) << $number)?)+
            }

            /// True if the motor with these faults has this fault.
            pub fn is_in(self, faults: Faults) -> bool {
                match self {
                    $($(Self::$fault => faults.$field == $value,)?)+
                    _ => false,
                }
            }

            /// Adds this fault to the faults of a motor. Does nothing for a fault of the hub.
            pub fn add_to(self, faults: &mut Faults) {
                match self {
                    $($(Self::$fault => faults.$field = $value,)?)+
                    _ => (),
                }
            }
        }
    };
}

// A number never changes its meaning. The number of a removed fault is not used again.
faults! {
    1 EncoderStale "encoder gives no reading" "encoder_stale" encoder_stale == true,
    2 EncoderStuck "no counts although driven" "stuck" encoder == Some(EncoderFault::Stuck),
    3 EncoderReversed "counts against the drive voltage" "reversed" encoder == Some(EncoderFault::Reversed),
    4 Overheated "winding too hot" "overheated" overheated == true,
    5 BridgeOff "bridge switched itself off" "bridge" bridge == true,
    6 BatteryUnknown "battery unknown" "battery_unknown" battery_unknown == true,
    16 Watchdog "watchdog",
    17 HardFault "hard fault",
    18 StackOverflow "stack overflow",
    19 Panic "panic",
    20 SupplyFell "supply of the chip fell",
    21 UnhandledInterrupt "interrupt without a handler",
    32 PowerOn "power on",
    33 ResetPin "reset pin",
    34 SoftwareReset "software reset",
    35 BrownOut "brown-out",
    36 OtherReset "other reset",
}

impl Fault {
    /// Returns the number: 1 to 15 for faults of a motor, 16 to 31 for faults of the hub, 32 and above for other
    /// resets.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Iterates over the faults of a motor whose bits are set.
    pub(super) fn in_bits(bits: u8) -> impl Iterator<Item = Self> {
        (1..8).filter(move |number| bits & 1 << number != 0).filter_map(Self::from_number)
    }
}
