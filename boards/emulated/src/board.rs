//! The boards whose images can be run.

use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// A board, and with it a chip.
///
/// ```
/// use emulated::Board;
///
/// assert_eq!("nucleo-h743zi2".parse(), Ok(Board::NucleoH743zi2));
/// assert_eq!(Board::default().core_hz(), 168_000_000);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Board {
    /// A board with an STM32F429. The emulated chip is the F427, which has the same manual (RM0090) and the same registers,
    /// except for a display controller.
    #[default]
    NucleoF429zi,
    /// A board with an STM32H743 (RM0433).
    NucleoH743zi2,
}

impl Board {
    /// All boards.
    pub const ALL: [Self; 2] = [Self::NucleoF429zi, Self::NucleoH743zi2];

    /// Returns the name of the board's package, which is also the name of its image.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NucleoF429zi => "nucleo-f429zi",
            Self::NucleoH743zi2 => "nucleo-h743zi2",
        }
    }

    /// Returns the name of the emulated chip.
    pub const fn chip(self) -> &'static str {
        match self {
            Self::NucleoF429zi => "STM32F427",
            Self::NucleoH743zi2 => "STM32H743",
        }
    }

    /// Returns the core's clock in Hz, as the firmware sets it. The emulated core executes one instruction in each cycle.
    pub const fn core_hz(self) -> u64 {
        match self {
            Self::NucleoF429zi => 168_000_000,
            Self::NucleoH743zi2 => 400_000_000,
        }
    }

    /// Returns the addresses of the RAM with the image's stack and statics. Its last 4 kB are the record of faults, which no start-up
    /// code clears.
    pub const fn ram(self) -> Range<u64> {
        match self {
            Self::NucleoF429zi => 0x2000_0000..0x2003_0000,
            Self::NucleoH743zi2 => 0x2000_0000..0x2002_0000,
        }
    }

    /// Returns the addresses of the flash.
    pub const fn flash(self) -> Range<u64> {
        0x0800_0000..0x0820_0000
    }

    /// Returns the addresses of the two pages of flash in which settings are stored.
    pub const fn store(self) -> Range<u64> {
        match self {
            Self::NucleoF429zi => 0x0810_0000..0x0810_8000,
            Self::NucleoH743zi2 => 0x081C_0000..0x0820_0000,
        }
    }

    /// Returns the package of the board's bootloader. `None` if the board has no bootloader.
    pub const fn bootloader(self) -> Option<&'static str> {
        match self {
            Self::NucleoF429zi => None,
            Self::NucleoH743zi2 => Some("boot-h743zi2"),
        }
    }

    /// Returns the board that the environment variable `MOTOR_HUB_BOARD` names, or the default board without this variable.
    ///
    /// # Errors
    /// Returns an error if no board has this name.
    pub fn of_environment() -> Result<Self, UnknownBoard> {
        std::env::var("MOTOR_HUB_BOARD").map_or(Ok(Self::default()), |name| name.parse())
    }
}

impl fmt::Display for Board {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// No board has the given name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no board {name}; there are {}", Board::ALL.map(Board::name).join(", "))]
pub struct UnknownBoard {
    /// The given name.
    pub name: String,
}

impl FromStr for Board {
    type Err = UnknownBoard;

    fn from_str(name: &str) -> Result<Self, UnknownBoard> {
        let named = Self::ALL.into_iter().find(|board| board.name() == name);
        named.ok_or_else(|| UnknownBoard { name: name.to_owned() })
    }
}
