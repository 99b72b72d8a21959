//! The memory map of this board.

include!("../stm32/link.rs");

/// RM0440 2.4. RAM is SRAM1, SRAM2 and the CCM SRAM behind them.
const MEMORY: &str = "MEMORY {
    FLASH  : ORIGIN = 0x08000000, LENGTH = 512K
    STACK  : ORIGIN = 0x20000000, LENGTH = 32K
    RAM    : ORIGIN = 0x20008000, LENGTH = 92K
    RECORD : ORIGIN = 0x2001F000, LENGTH = 4K
}
";

fn main() {
    link(MEMORY);
}
