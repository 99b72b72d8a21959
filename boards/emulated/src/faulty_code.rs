//! Code of the bench, in flash that no image uses: tasks are made to run it as a fault.

use std::path::Path;

use rigless::image::{Error, Image};

/// Where it is.
const AT: u64 = 0x080E_0000;

/// What a task does that never returns.
#[derive(Clone, Copy, Debug)]
pub(crate) enum FaultyCode {
    /// It loops.
    Loops = 0,
    /// It calls itself until no stack is left, with the least frame there is.
    Overflows = 4,
    /// It divides by zero, in line 77, column 7 of "bench.rs".
    Panics = 12,
}

impl FaultyCode {
    /// Its first instruction.
    pub(crate) const fn address(self) -> u64 {
        AT + self as u64
    }
}

/// All of them (ARMv7-M ARM A7.7), for an image that divides by zero at this address.
pub(crate) fn image(divides_by_zero: u64) -> Result<Image, Error> {
    let [place, name] = [28, 44].map(|offset| AT as u32 + offset);
    let words: [u32; 11] = [
        0xE7FD_BF00, // NOP; B back to it: as the end of every fault handler
        0xF7FF_B500, // PUSH {LR}; BL back to it
        0xBF00_FFFD,
        0x4902_4801, // LDR R0, place; LDR R1, what divides; BX R1
        0xBF00_4708,
        place,
        divides_by_zero as u32 | 1,
        // The place: a file's name and its length, with a zero at its end, line and column.
        name,
        9,
        77,
        7,
    ];
    let code = words.into_iter().flat_map(u32::to_le_bytes);
    Image::new(Path::new("code of the bench"), code.chain(*b"bench.rs\0").collect(), Some(AT))
}
