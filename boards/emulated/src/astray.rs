//! Code of the bench's own, in flash that no image reaches, for tasks to be led astray to.

use std::path::Path;

use rigless::image::{Error, Image};

/// Where it is.
const AT: u64 = 0x080E_0000;

/// What a task does that never returns.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Astray {
    /// It loops.
    Loops = 0,
    /// It calls itself until no stack is left, with the least frame there is.
    Overflows = 4,
    /// The same with frames of 16 kB.
    OverflowsByMuch = 10,
}

impl Astray {
    /// Its first instruction.
    pub(crate) const fn address(self) -> u64 {
        AT + self as u64
    }
}

/// All of them (ARMv7-M ARM A7.7).
pub(crate) fn image() -> Result<Image, Error> {
    let halves: [u16; 11] = [
        0xBF00, 0xE7FD, // NOP; B back to it: as the end of every fault handler
        0xB500, 0xF7FF, 0xFFFD, // PUSH {LR}; BL back to it
        0xB500, 0xF5AD, 0x4D80, 0x9000, // PUSH {LR}; SUB SP, SP, #16384; STR R0, [SP]
        0xF7FF, 0xFFFA, // BL back to the PUSH
    ];
    let bytes = halves.iter().flat_map(|half| half.to_le_bytes()).collect();
    Image::new(Path::new("code of the bench"), bytes, Some(AT))
}
