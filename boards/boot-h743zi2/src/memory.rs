//! Regions of memory from which no code may be executed, in addition to the regions of the hub's stack guard.

use crate::mpu::{FULL_ACCESS, NEVER_EXECUTED, WRITTEN_THROUGH, protect, region};
use cortex_m::peripheral::MPU;

/// The system memory must be strongly ordered and not executable. Otherwise the core speculates into it, and the flash shows
/// errors that no access caused. Reading stays allowed: the factory's calibration of VREFINT is there. The second bank holds
/// settings and firmware that does not run.
///
/// The addresses of memory outside the chip are normal memory without a region, so the core may speculate into them. Their
/// controllers have no clock, and such an access might not end.
const REGIONS: [(u32, u32); 4] = [
    (0x6000_0000, region(512 << 20, NEVER_EXECUTED)),
    (0x8000_0000, region(512 << 20, NEVER_EXECUTED)),
    // Strongly ordered: TEX 0, S.
    (0x1FF0_0000, region(512 << 10, NEVER_EXECUTED | FULL_ACCESS | 1 << 18)),
    (0x0810_0000, region(1 << 20, NEVER_EXECUTED | FULL_ACCESS | WRITTEN_THROUGH)),
];

/// Number of the first of these regions. The hub's stack guard uses lower numbers.
const FIRST: u32 = 8;

/// Forbids the execution of code in the system memory and in the second bank, and every access to memory outside the chip.
pub fn execute_first_bank_only(mpu: &mut MPU) {
    protect(mpu, FIRST, &REGIONS);
}
