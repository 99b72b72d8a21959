//! Tells the linker where the bootloader's sections go: into the first sector of the flash, and into the core's own
//! RAM. Names the file of the public key for signed firmware.

use std::path::{Path, PathBuf};

/// Memory map of the bootloader. RAM leaves out the last 4 kB of the DTCM, which hold the hub's record of faults. A
/// reset does not clear this record, and the bootloader must not overwrite it.
const MEMORY: &str = "MEMORY {
    FLASH : ORIGIN = 0x08000000, LENGTH = 128K
    RAM   : ORIGIN = 0x20000000, LENGTH = 124K
}
";

fn main() {
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets it")).join("boot");
    std::fs::create_dir_all(&out).expect("the output directory is writable");
    std::fs::write(out.join("memory.x"), MEMORY).expect("the output directory is writable");
    // These arguments are for the bootloader's program only. The hub uses the library of this package, and has a memory
    // map of its own.
    println!("cargo:rustc-link-arg-bins=-L{}", out.display());
    // Turns page alignment off. With page alignment the first segment would begin before the flash.
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rerun-if-changed=build.rs");
    if std::env::var_os("CARGO_FEATURE_SIGNED").is_some() {
        name_key();
    }
}

/// Passes the file of the public key to `include_bytes`. A relative name starts at the repository's root.
fn name_key() {
    println!("cargo:rerun-if-env-changed=UPDATE_KEY");
    let Some(name) = std::env::var_os("UPDATE_KEY") else {
        panic!(
            "the feature `signed` needs UPDATE_KEY, the file of a public key: openssl pkey -pubout -outform DER"
        );
    };
    let file = Path::new("../..").join(name);
    let file = file.canonicalize().unwrap_or_else(|error| panic!("UPDATE_KEY: {}: {error}", file.display()));
    println!("cargo:rerun-if-changed={}", file.display());
    println!("cargo:rustc-env=UPDATE_KEY={}", file.display());
}
