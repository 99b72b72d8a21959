//! Faulty code of the bench, in flash beyond the end of every image. A task is made to run this code as a fault.

use std::path::Path;

use rigless::image::{Error, Image};

/// Address of the code.
const AT: u64 = 0x080E_0000;

/// What a task does that never returns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultyCode {
    /// The code loops.
    Loops = 0,
    /// The code calls itself until no stack is left, with the smallest possible frame of 4 bytes.
    Overflows = 4,
    /// The code calls the image's function that panics after a division by zero. The panic names line 77, column 7 of
    /// "bench.rs".
    Panics = 12,
    /// The code loops with all interrupts masked.
    LoopsMasked = 28,
}

impl FaultyCode {
    /// Address of the first instruction.
    pub(crate) const fn address(self) -> u64 {
        AT + self as u64
    }
}

/// Makes a flash image with all faulty codes. `division_panic` is the address of the firmware's function
/// `panic_const_div_by_zero`. Section A7.7 of the ARMv7-M manual defines the instructions.
pub(crate) fn image(division_panic: u64) -> Result<Image, Error> {
    let [location, name] = [32, 48].map(|offset| AT as u32 + offset);
    let words: [u32; 12] = [
        0xE7FD_BF00, // NOP, then a branch to this NOP; the firmware's fault handlers end in the same loop
        0xF7FF_B500, // PUSH {LR}, then a call of this PUSH
        0xBF00_FFFD,
        // R0 is the address of the panic's location, R1 that of the panic function. BX jumps to this function.
        0x4902_4801, // LDR R0, location; LDR R1, division_panic; BX R1
        0xBF00_4708,
        location,
        division_panic as u32 | 1,
        0xE7FE_B672, // CPSID I, then a branch to itself
        // The location has four words: address and length of the file name, line, column. The length includes the zero at the
        // end of the name.
        name,
        9,
        77,
        7,
    ];
    let code = words.into_iter().flat_map(u32::to_le_bytes);
    Image::new(Path::new("code of the bench"), code.chain(*b"bench.rs\0").collect(), Some(AT))
}
