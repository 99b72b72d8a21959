//! Tells the linker where this image's sections go: cortex-m-rt's script round the memory map below, and defmt's.

use std::path::{Path, PathBuf};

/// RM0433 2.4. Of the flash the first bank: the second has the settings, and may be written while the first is executed.
/// Behind a bootloader, the slot that it boots: `boot_h743zi2::layout::ACTIVE`.
/// Of the RAMs the core's own, DTCM, without wait states and beside all caches: see
/// docs/decisions/0014-caches-of-the-h743.md. DMA1 and DMA2 do not reach it.
const FLASH: &str = "ORIGIN = 0x08000000, LENGTH = 1024K";
const SLOT: &str = "ORIGIN = 0x08020000, LENGTH = 512K";
const RAM: &str = "
    STACK  : ORIGIN = 0x20000000, LENGTH = 32K
    RAM    : ORIGIN = 0x20008000, LENGTH = 92K
    RECORD : ORIGIN = 0x2001F000, LENGTH = 4K
";

fn main() {
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    let flash = if std::env::var_os("CARGO_FEATURE_BOOTLOADER").is_some() { SLOT } else { FLASH };
    let map = format!("MEMORY {{\n    FLASH : {flash}{RAM}}}\n{}", include_str!("../stm32/sections.x"));
    std::fs::write(out.join("memory.x"), map).expect("the output directory is writable");
    println!("cargo:rustc-link-search={}", out.display());
    // Without page alignment, or the first segment would begin before the flash does.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=../stm32/sections.x");
    if std::env::var_os("CARGO_FEATURE_SIGNED").is_some() {
        name_key();
    }
}

/// Where the public key is, for `include_bytes`: absolute, or as seen from the repository's root.
fn name_key() {
    println!("cargo:rerun-if-env-changed=UPDATE_KEY");
    let Some(name) = std::env::var_os("UPDATE_KEY") else {
        panic!(
            "the feature `signed` wants UPDATE_KEY, the file of a public key: openssl pkey -pubout -outform DER"
        );
    };
    let file = Path::new("../..").join(name);
    let file = file.canonicalize().unwrap_or_else(|error| panic!("UPDATE_KEY: {}: {error}", file.display()));
    println!("cargo:rerun-if-changed={}", file.display());
    println!("cargo:rustc-env=UPDATE_KEY={}", file.display());
}
