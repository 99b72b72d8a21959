//! A guard at the stack's end: an overflow ends in a HardFault, which opens the bridges and reports.
//!
//! The stack is at RAM's low end (`sections.x`), and the memory protection unit forbids its lowest part. The unit is off while
//! a HardFault is handled (HFNMIENA is 0; PM0214 and PM0253 4.2), so the handler uses the guarded memory as its stack. A stack
//! frame larger than the guard could reach below the beginning of RAM. The core then locks up in its first fault, and the watchdog
//! resets the chip. An H743 from revision V on, and a G474, also switch their PWM off when the core locks up.

use crate::mpu::{FULL_ACCESS, NEVER_EXECUTED, WRITTEN_THROUGH, protect, region};
use core::ops::Range;
use cortex_m::peripheral::MPU;

/// The guard, which is the lowest 8 kB of RAM. The memory protection unit needs a power of two.
const GUARD: Range<u32> = 0x2000_0000..0x2000_2000;

const REGIONS: [(u32, u32); 3] = [
    // The flash.
    (0x0800_0000, region(2 << 20, FULL_ACCESS | WRITTEN_THROUGH)),
    // RAM: normal memory, written back (TEX 1, C, B).
    (0x2000_0000, region(256 << 10, FULL_ACCESS | NEVER_EXECUTED | 1 << 19 | 1 << 17 | 1 << 16)),
    (GUARD.start, region(GUARD.end - GUARD.start, NEVER_EXECUTED)),
];

/// Forbids accesses to [`GUARD`], and the execution of code in RAM.
pub fn guard(mpu: &mut MPU) {
    protect(mpu, 0, &REGIONS);
}

/// True if a stack pointer at this address means an overflow.
pub(crate) const fn overflowed(stack_pointer: u32) -> bool {
    stack_pointer < GUARD.end
}
