//! Tells the linker where the bootloader's sections go: the first sector of the flash, and the core's own RAM.

use std::path::PathBuf;

/// Of the RAM all but the hub's record of what happened: a reset leaves that alone, and so does this.
const MEMORY: &str = "MEMORY {
    FLASH : ORIGIN = 0x08000000, LENGTH = 128K
    RAM   : ORIGIN = 0x20000000, LENGTH = 124K
}
";

fn main() {
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it")).join("boot");
    std::fs::create_dir_all(&out).expect("the output directory is writable");
    std::fs::write(out.join("memory.x"), MEMORY).expect("the output directory is writable");
    // For the program alone: the hub, which uses the library beside it, has a memory map of its own.
    println!("cargo:rustc-link-arg-bins=-L{}", out.display());
    // Without page alignment, or the first segment would begin before the flash does.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-changed=build.rs");
}
