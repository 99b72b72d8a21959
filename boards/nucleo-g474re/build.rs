//! Tells the linker where this image's sections go: cortex-m-rt's script round the memory map that
//! embassy-stm32 supplies for the chip, and defmt's.

fn main() {
    // Without page alignment, or the first segment would begin before the flash does.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo:rerun-if-changed=build.rs");
}
