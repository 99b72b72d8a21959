//! Tells the linker where this image's sections go: cortex-m-rt's script round the memory map below, and defmt's.

use std::path::PathBuf;

/// RM0090 2.3.1, 3 and 3.4. Of the flash the first bank: the second has the settings, and may be written while the first is
/// executed. RAM is SRAM1 to 3; the core-coupled memory, which no DMA reaches, is left alone.
const MEMORY: &str = "MEMORY {
    FLASH  : ORIGIN = 0x08000000, LENGTH = 1024K
    STACK  : ORIGIN = 0x20000000, LENGTH = 32K
    RAM    : ORIGIN = 0x20008000, LENGTH = 156K
    RECORD : ORIGIN = 0x2002F000, LENGTH = 4K
}
";

fn main() {
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    let map = [MEMORY, include_str!("../stm32/sections.x")].concat();
    std::fs::write(out.join("memory.x"), map).expect("the output directory is writable");
    println!("cargo:rustc-link-search={}", out.display());
    // Without page alignment, or the first segment would begin before the flash does.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=../stm32/sections.x");
}
