//! The layout of the flash: two banks of eight sectors of 128 kB (RM0433 4.3.4).
//!
//! | bank | sectors | |
//! |---|---|---|
//! | 1 | 0 | the bootloader |
//! | 1 | 1 to 4 | the slot that is booted |
//! | 1 | 5 to 7 | nothing |
//! | 2 | 0 to 4 | the slot that new firmware is written to; it has one sector more, which the swap of the slots needs |
//! | 2 | 5 | the bootloader's state |
//! | 2 | 6, 7 | the hub's settings |
//!
//! The hub writes only into the second bank, because a write or an erasure stops code that runs from the same bank. An erasure
//! takes seconds.

use core::ops::Range;

/// Bytes of a sector, the smallest unit that can be erased.
pub const SECTOR: u32 = 128 * 1024;

/// The slot that is booted, as offsets from the first bank's start.
pub const ACTIVE: Range<u32> = SECTOR..5 * SECTOR;

/// First address of the slot that is booted. The hub's build.rs has the same address.
pub const ORIGIN: u32 = 0x0800_0000 + ACTIVE.start;

/// The slot that new firmware is written to, as offsets from the second bank's start.
pub const DOWNLOAD: Range<u32> = 0..5 * SECTOR;

/// The bootloader's state, as offsets from the second bank's start.
pub const STATE: Range<u32> = 5 * SECTOR..6 * SECTOR;

/// The hub's settings, as offsets from the second bank's start.
pub const STORE: Range<u32> = 6 * SECTOR..8 * SECTOR;

/// The core's own RAM (DTCM, 128 kB), where every image has its stack.
pub const RAM: Range<u32> = 0x2000_0000..0x2002_0000;
