//! Regions of the memory protection unit. The bootloader of the NUCLEO-H743ZI2 has this file too.

use cortex_m::asm;
use cortex_m::peripheral::MPU;

/// Attribute of MPU_RASR: nothing is executed.
pub(crate) const NEVER_EXECUTED: u32 = 1 << 28;
/// Attribute of MPU_RASR: all code may read and write.
pub(crate) const FULL_ACCESS: u32 = 0b011 << 24;
/// Attributes of MPU_RASR: normal memory, written through (TEX 0, C).
pub(crate) const WRITTEN_THROUGH: u32 = 1 << 17;

/// MPU_CTRL: enabled, with the chip's own map for everything else.
const ON: u32 = 1 << 2 | 1;

/// MPU_RASR of an enabled region, whose size is a power of two (PM0214 4.2, PM0253 4.6).
pub(crate) const fn region(bytes: u32, attributes: u32) -> u32 {
    attributes | (bytes.ilog2() - 1) << 1 | 1
}

/// Sets regions from this number on, as MPU_RBAR and MPU_RASR, and enables the unit. Where two regions overlap, the higher
/// number counts.
#[expect(
    unsafe_code,
    reason = "a register that a wrong value would take memory away with has no safe access"
)]
pub(crate) fn protect(mpu: &mut MPU, first: u32, regions: &[(u32, u32)]) {
    // SAFETY: both callers protect only memory without variables, and memory without the image's code.
    unsafe {
        for (number, (base, attributes)) in (first..).zip(regions) {
            mpu.rnr.write(number);
            mpu.rbar.write(*base);
            mpu.rasr.write(*attributes);
        }
        mpu.ctrl.write(ON);
    }
    asm::dsb();
    asm::isb();
}
