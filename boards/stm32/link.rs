// The body of a board's build.rs, which includes this file.

/// Tells the linker where the sections of an image go: writes the memory map, and names the linker scripts of
/// `cortex-m-rt` and defmt.
fn link(memory: &str) {
    let out = std::path::PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it"));
    let map = [memory, include_str!("../stm32/sections.x")].concat();
    std::fs::write(out.join("memory.x"), map).expect("the output directory is writable");
    println!("cargo:rustc-link-search={}", out.display());
    // Turns page alignment off. With page alignment the first segment would begin before the flash.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    for file in ["build.rs", "../stm32/link.rs", "../stm32/sections.x"] {
        println!("cargo:rerun-if-changed={file}");
    }
}
