//! `cargo xtask fuzz`: random bytes for a minute each into the host link and into the store of settings.

use crate::tool::{Failed, cargo, cargo_command, command, none, output, root, run};
use std::fs;
use std::path::Path;
use std::process::Command;
use std::thread;

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
    let files = fs::read_dir(&folder).map_err(|error| Failed::at(&folder, error))?.flatten();
    let name =
        |file: fs::DirEntry| file.path().file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let targets: Vec<String> = files.map(name).collect();
    run(&mut fuzz(&["build"]))?;
    // Each target is one process on one core, so all run at the same time.
    thread::scope(|scope| {
        let running: Vec<_> = targets.iter().map(|name| scope.spawn(|| one_minute(name))).collect();
        running.into_iter().try_for_each(|target| target.join().expect("a task does not panic"))
    })
}

/// Returns a command of cargo-fuzz. With the variable the pinned toolchain accepts the options of nightly. An installed nightly
/// may be older than the pinned toolchain.
fn fuzz(arguments: &[&str]) -> Command {
    let (name, rest) = arguments.split_first().expect("a command of cargo-fuzz");
    let mut command = cargo_command(&[&["fuzz", name, "--target-dir", "target/fuzz"], rest].concat());
    command.env("RUSTC_BOOTSTRAP", "1");
    command
}

fn one_minute(target: &str) -> Result<(), Failed> {
    let corpus = format!("{CORPUS}/{target}");
    fs::create_dir_all(root().join(&corpus)).map_err(|error| Failed::at(Path::new(&corpus), error))?;
    let limits = ["-max_total_time=60", "-max_len=4096", "-print_final_stats=1", "-verbosity=0"];
    run(&mut fuzz(&[&["run", target, &corpus, "--"], &limits[..]].concat()))
}
