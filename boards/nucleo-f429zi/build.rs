//! The memory map of this board.

include!("../stm32/link.rs");

/// RM0090 2.3.1, 3 and 3.4. The flash is the first bank: the second bank has the settings, and may be written while code of
/// the first runs. RAM is SRAM1 to 3. The core-coupled memory, which no DMA reaches, is not used.
const MEMORY: &str = "MEMORY {
    FLASH  : ORIGIN = 0x08000000, LENGTH = 1024K
    STACK  : ORIGIN = 0x20000000, LENGTH = 32K
    RAM    : ORIGIN = 0x20008000, LENGTH = 156K
    RECORD : ORIGIN = 0x2002F000, LENGTH = 4K
}
";

fn main() {
    link(MEMORY);
}
