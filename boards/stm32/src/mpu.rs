//! Regions of the memory protection unit (MPU). The bootloader of the NUCLEO-H743ZI2 includes this file too.

use cortex_m::asm;
use cortex_m::peripheral::MPU;

/// Attribute of MPU_RASR: no code is executed from the region.
pub(crate) const NEVER_EXECUTED: u32 = 1 << 28;
/// Attribute of MPU_RASR: all code may read and write.
pub(crate) const FULL_ACCESS: u32 = 0b011 << 24;
/// Attributes of MPU_RASR: normal memory, written through (TEX 0, C).
pub(crate) const WRITTEN_THROUGH: u32 = 1 << 17;

/// Value of MPU_CTRL: the unit is enabled, and memory outside of the regions has the attributes of the chip's memory map.
const ON: u32 = 1 << 2 | 1;

/// Returns the value of MPU_RASR for an enabled region of `bytes`, a power of two of at least 32 (PM0214 4.2, PM0253 4.6).
pub(crate) const fn region(bytes: u32, attributes: u32) -> u32 {
    attributes | (bytes.ilog2() - 1) << 1 | 1
}

/// Sets the regions with the numbers from `first` on, and enables the unit. A region is given as its values of MPU_RBAR and MPU_RASR.
/// Where two regions overlap, the region with the higher number counts.
#[expect(
    unsafe_code,
    reason = "the registers of the MPU have no safe access, because wrong values make memory inaccessible"
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
