//! What of the chip's memory nothing is executed from, on top of what the hub's own guard of its stack says.

use cortex_m::asm;
use cortex_m::peripheral::MPU;

/// Regions as MPU_RBAR and MPU_RASR have them (PM0253 4.6).
///
/// The system memory must be strongly ordered, and not be executed: the core speculates into it otherwise, and the flash
/// then shows errors that nobody made. It can be read: the factory's calibration of VREFINT is in it. The second bank holds
/// settings and firmware that does not run.
const REGIONS: [(u32, u32); 2] = [
    // Strongly ordered: TEX 0, S.
    (0x1FF0_0000, region(512 << 10, 1 << 18)),
    // Normal memory, written through: TEX 0, C.
    (0x0810_0000, region(1 << 20, 1 << 17)),
];

/// Numbers of these regions. Lower ones are the hub's: of two regions that overlap the higher number counts.
const FIRST: u32 = 8;

const NEVER_EXECUTED: u32 = 1 << 28;
const FULL_ACCESS: u32 = 0b011 << 24;

/// An enabled region of so many bytes, a power of two, that nothing is executed from.
const fn region(bytes: u32, attributes: u32) -> u32 {
    NEVER_EXECUTED | FULL_ACCESS | attributes | (bytes.ilog2() - 1) << 1 | 1
}

/// MPU_CTRL: enabled, with the chip's own map for everything else.
const ON: u32 = 1 << 2 | 1;

/// From here on nothing is executed from the system memory and from the second bank.
#[expect(
    unsafe_code,
    reason = "a register that a wrong value would take memory away with has no safe access"
)]
pub fn execute_first_bank_only(mpu: &mut MPU) {
    // SAFETY: all of it can be read and written as before, and no code of an image lies there.
    unsafe {
        for (number, (base, attributes)) in (FIRST..).zip(REGIONS) {
            mpu.rnr.write(number);
            mpu.rbar.write(base);
            mpu.rasr.write(attributes);
        }
        mpu.ctrl.write(ON);
    }
    asm::dsb();
    asm::isb();
}
