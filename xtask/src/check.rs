//! `cargo xtask check`: checks of the sources that run no program of the project.

use crate::board::{ALL, BENCH, DRIVERS, TARGET};
use crate::tool::{Failed, cargo, cargo_command, command, none, run};
use crate::try_page;

/// Targets of cores without atomic read-modify-write, for which only the library is checked.
const SMALL_CORES: [&str; 2] = ["thumbv6m-none-eabi", "riscv32imc-unknown-none-elf"];

const DENY: [&str; 3] = ["--", "-D", "warnings"];

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    none(arguments)?;
    let chips = || ALL.iter().map(|board| board.name).chain([BENCH]);
    // One cargo command can build neither for two chips, nor for a chip and this computer.
    let not_host = chips().chain([DRIVERS, try_page::PACKAGE]);
    let host: Vec<&str> =
        ["--workspace"].into_iter().chain(not_host.flat_map(|name| ["--exclude", name])).collect();

    cargo(&["fmt", "--all", "--check"])?;
    // The second command checks the program with its feature `emulated`. It names the same packages as the first, so that all other
    // packages have the same features and are not checked again.
    for features in [&[][..], &["--features", "motor-hub-cli/emulated"]] {
        cargo(&[&["clippy"], &host[..], features, &["--all-targets"], &DENY].concat())?;
    }
    run(command("rustup").args(["target", "add", try_page::TARGET]))?;
    let tab = ["clippy", "--package", try_page::PACKAGE, "--target", try_page::TARGET];
    cargo(&[&tab[..], &DENY].concat())?;
    let library = ["clippy", "--package", "motor-hub", "--lib"];
    cargo(&[&library[..], &DENY].concat())?;
    cargo(&[&library[..], &["--no-default-features"], &DENY].concat())?;
    for core in SMALL_CORES {
        cargo(&[&library[..], &["--target", core], &DENY].concat())?;
    }
    // The lints of a board include those of the drivers that it uses.
    for package in chips() {
        let image = ["clippy", "--package", package, "--target", TARGET, "--profile", "firmware"];
        cargo(&[&image[..], &DENY].concat())?;
    }
    let documents = [&["doc", "--no-deps", "--document-private-items"], &host[..]].concat();
    run(cargo_command(&documents).env("RUSTDOCFLAGS", "-D warnings"))
}
