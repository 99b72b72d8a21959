//! A guard at the stack's end: what overflows ends as a HardFault, which has room to open the bridges and to say so.
//!
//! The stack lies at RAM's low end (`sections.x`) and its lowest part may not be touched, by the memory protection
//! unit's word. That unit is off while a HardFault is handled (HFNMIENA is 0; PM0214 and PM0253 4.2), so the handler
//! finds there the stack it needs. A frame larger than the guard could pass it and leave RAM: the core then locks up in its
//! first fault, and the watchdog ends that.

use core::ops::Range;
use cortex_m::asm;
use cortex_m::peripheral::MPU;

/// The lowest part of RAM: 8 kB, a power of two as the unit wants it.
const GUARD: Range<u32> = 0x2000_0000..0x2000_2000;

/// Regions as MPU_RBAR and MPU_RASR have them (PM0214 and PM0253 4.2): of two that overlap the higher number counts.
const REGIONS: [(u32, u32); 3] = [
    // The flash: normal memory, written through (TEX 0, C).
    (0x0800_0000, region(2 << 20, FULL_ACCESS | 1 << 17)),
    // RAM: normal memory, written back (TEX 1, C, B), of which nothing is executed.
    (0x2000_0000, region(256 << 10, FULL_ACCESS | NEVER_EXECUTED | 1 << 19 | 1 << 17 | 1 << 16)),
    (GUARD.start, region(GUARD.end - GUARD.start, NEVER_EXECUTED)),
];

const NEVER_EXECUTED: u32 = 1 << 28;
const FULL_ACCESS: u32 = 0b011 << 24;

/// An enabled region of so many bytes, a power of two.
const fn region(bytes: u32, attributes: u32) -> u32 {
    attributes | (bytes.ilog2() - 1) << 1 | 1
}

/// MPU_CTRL: enabled, with the chip's own map for everything else.
const ON: u32 = 1 << 2 | 1;

/// From here on nothing below [`GUARD`]'s end may be touched, and nothing in RAM be executed.
#[expect(
    unsafe_code,
    reason = "a register that a wrong value would take memory away with has no safe access"
)]
pub fn guard(mpu: &mut MPU) {
    // SAFETY: no variable lies there, for the linker has put the stack there alone.
    unsafe {
        for (number, (base, attributes)) in (0..).zip(REGIONS) {
            mpu.rnr.write(number);
            mpu.rbar.write(base);
            mpu.rasr.write(attributes);
        }
        mpu.ctrl.write(ON);
    }
    asm::dsb();
    asm::isb();
}

/// Whether a stack that has come down to here has overflowed.
pub(crate) const fn overflowed(stack_pointer: u32) -> bool {
    stack_pointer < GUARD.end
}
