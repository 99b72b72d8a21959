//! A guard at the stack's end: what overflows ends as a HardFault, which has room to open the bridges and to say so.
//!
//! The stack lies at RAM's low end (`sections.x`) and its lowest part may not be touched, by the memory protection
//! unit's word. That unit is off while a HardFault is handled (HFNMIENA is 0; PM0214 and PM0253 4.2), so the handler
//! finds there the stack it needs. A frame larger than the guard, which no function of the images has, passes it
//! and leaves RAM: the core then locks up with its first fault, and the watchdog ends that.

use core::ops::Range;
use cortex_m::asm;
use cortex_m::peripheral::MPU;

/// The lowest part of RAM: 8 kB, a power of two as the unit wants it.
const GUARD: Range<u32> = 0x2000_0000..0x2000_2000;

/// MPU_RASR: enabled, SIZE in bits less one, no access (AP 000), nothing executed.
const NO_ACCESS: u32 = 1 << 28 | (GUARD.end - GUARD.start).ilog2() - 1 << 1 | 1;

/// MPU_CTRL: enabled, with the chip's own map for everything else.
const ON: u32 = 1 << 2 | 1;

/// From here on nothing below [`GUARD`]'s end may be touched.
#[expect(unsafe_code, reason = "a register that a wrong value would take memory away with has no safe access")]
pub fn guard(mpu: &mut MPU) {
    // SAFETY: no variable lies there, for the linker has put the stack there alone.
    unsafe {
        mpu.rnr.write(0);
        mpu.rbar.write(GUARD.start);
        mpu.rasr.write(NO_ACCESS);
        mpu.ctrl.write(ON);
    }
    asm::dsb();
    asm::isb();
}

/// Whether a stack that has come down to here has overflowed.
pub(crate) const fn overflowed(stack_pointer: u32) -> bool {
    stack_pointer < GUARD.end
}
