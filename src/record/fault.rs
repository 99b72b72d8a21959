//! Every fault by its number, the same in the record, on the link, in logs and in `docs/reference/fault-numbers.md`.

use crate::motion::EncoderFault;
use crate::motor::Faults;

macro_rules! faults {
    ($($number:literal $fault:ident $name:literal,)+) => {
        /// What went wrong, or why the chip began anew. `docs/reference/fault-numbers.md` has a section for each.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        #[expect(missing_docs, reason = "each is named below, and explained in docs/reference/fault-numbers.md")]
        pub enum Fault {
            $($fault = $number,)+
        }

        impl Fault {
            /// All of them, by number.
            pub const ALL: &[Self] = &[$(Self::$fault),+];

            /// The fault with this number.
            pub const fn from_number(number: u8) -> Option<Self> {
                match number {
                    $($number => Some(Self::$fault),)+
                    _ => None,
                }
            }

            /// In a few words.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$fault => $name,)+
                }
            }
        }
    };
}

// A number keeps its meaning for ever: what goes leaves a gap.
faults! {
    1 EncoderSilent "encoder gives no reading",
    2 EncoderStuck "encoder does not count",
    3 EncoderReversed "encoder counts backwards",
    4 Overheated "winding too hot",
    5 BridgeOff "bridge switched itself off",
    6 BatteryUnknown "battery unknown",
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
    /// 1 to 15 are of a motor, 16 to 31 of the hub, 32 and more are resets that nothing wrong led to.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Those that keep a motor from obeying, as bits by number.
    pub(super) const fn bits_of(faults: Faults) -> u8 {
        let encoder = match faults.encoder {
            None => 0,
            Some(EncoderFault::Stuck) => bit(Self::EncoderStuck),
            Some(EncoderFault::Reversed) => bit(Self::EncoderReversed),
        };
        encoder
            | when(faults.encoder_stale, Self::EncoderSilent)
            | when(faults.overheated, Self::Overheated)
            | when(faults.bridge, Self::BridgeOff)
            | when(faults.battery_unknown, Self::BatteryUnknown)
    }

    /// Those of a motor whose bits are set.
    pub(super) fn in_bits(bits: u8) -> impl Iterator<Item = Self> {
        Self::ALL.iter().copied().take(6).filter(move |fault| bits & bit(*fault) != 0)
    }
}

/// Of a motor's faults, 1 to 7.
const fn bit(fault: Fault) -> u8 {
    1 << (fault.number() & 7)
}

const fn when(is: bool, fault: Fault) -> u8 {
    if is { bit(fault) } else { 0 }
}
