//! `cargo xtask fuzz`: random bytes for a minute each into the host link and into the store of settings.

use crate::tool::{Failed, cargo, cargo_command, command, none, output, root, run};
use std::fs;
use std::path::Path;

/// Folder with a folder for each target: the inputs with which the fuzzer has reached new code.
const CORPUS: &str = "target/fuzz/corpus";

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    none(arguments)?;
    if output(command("c++").arg("--version")).is_err() {
        println!("fuzz: left out, the fuzzer needs a C++ compiler");
        return Ok(());
    }
    if output(command("cargo-fuzz").arg("--version")).is_err() {
        cargo(&["install", "--locked", "--quiet", "cargo-fuzz"])?;
    }
    let folder = root().join("fuzz/fuzz_targets");
    for target in fs::read_dir(&folder).map_err(|error| Failed::at(&folder, error))?.flatten() {
        let name = target.path().file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let corpus = format!("{CORPUS}/{name}");
        fs::create_dir_all(root().join(&corpus)).map_err(|error| Failed::at(Path::new(&corpus), error))?;
        let fuzz = ["fuzz", "run", "--target-dir", "target/fuzz", &name, &corpus, "--"];
        let minute = ["-max_total_time=60", "-max_len=4096", "-print_final_stats=1", "-verbosity=0"];
        // With this variable the pinned toolchain accepts the options of nightly. An installed nightly may be older than the
        // pinned toolchain.
        run(cargo_command(&[&fuzz[..], &minute].concat()).env("RUSTC_BOOTSTRAP", "1"))?;
    }
    Ok(())
}
