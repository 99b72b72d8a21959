//! The memory map of this board.

include!("../stm32/link.rs");

/// RM0433 2.4. The flash is the first bank: the second bank has the settings, and may be written while code of the first runs.
const FLASH: &str = "ORIGIN = 0x08000000, LENGTH = 1024K";
/// An image behind a bootloader has only the slot that the bootloader boots: `boot_h743zi2::layout::ACTIVE`.
const SLOT: &str = "ORIGIN = 0x08020000, LENGTH = 512K";
/// RAM is the DTCM, which the core accesses without wait states and without a cache:
/// docs/decisions/0014-caches-of-the-h743.md. DMA1 and DMA2 do not reach it.
const RAM: &str = "
    STACK  : ORIGIN = 0x20000000, LENGTH = 32K
    RAM    : ORIGIN = 0x20008000, LENGTH = 92K
    RECORD : ORIGIN = 0x2001F000, LENGTH = 4K
";

fn main() {
    let flash = if std::env::var_os("CARGO_FEATURE_BOOTLOADER").is_some() { SLOT } else { FLASH };
    link(&format!("MEMORY {{\n    FLASH : {flash}{RAM}}}\n"));
}
