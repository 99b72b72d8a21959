//! All faults and their numbers. Record, link, logs and `docs/reference/fault-numbers.md` use these numbers.

use crate::motor::EncoderFault;
use crate::motor::Faults;

macro_rules! faults {
    ($($number:literal $fault:ident $name:literal,)+) => {
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

            /// Returns the fault with this number, or `None` if no fault has it.
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
        }
    };
}

// A number never changes its meaning. The number of a removed fault is not used again.
faults! {
    1 EncoderSilent "encoder gives no reading",
    2 EncoderStuck "no counts although driven",
    3 EncoderReversed "counts against the drive voltage",
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
    /// Returns the number: 1 to 15 for faults of a motor, 16 to 31 for faults of the hub, 32 and above for other
    /// resets.
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// Iterates over the faults of a motor, in the order of their numbers. The ROS 2 package, a workspace of its own, uses this.
    pub fn of_motor(faults: Faults) -> impl Iterator<Item = Self> {
        Self::in_bits(Self::bits_of(faults))
    }

    /// Returns the faults of a motor as bits. Bit n stands for the fault with the number n.
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

    /// Iterates over the faults of a motor whose bits are set.
    pub(super) fn in_bits(bits: u8) -> impl Iterator<Item = Self> {
        (1..8).filter(move |number| bits & 1 << number != 0).filter_map(Self::from_number)
    }
}

/// Returns the bit of a motor's fault, in which bit n is set for the fault number n. The number must be 1 to 7.
const fn bit(fault: Fault) -> u8 {
    1 << (fault.number() & 7)
}

/// Returns the bit of `fault` if the fault is present, otherwise 0.
const fn when(present: bool, fault: Fault) -> u8 {
    if present { bit(fault) } else { 0 }
}
