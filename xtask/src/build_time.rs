//! `cargo xtask build-time`: how long the two commands of the README take on a fresh machine.

use crate::tool::{Failed, cargo_command, command, none, output, root, run};
use std::collections::BTreeSet;
use std::path::Path;
use std::time::Instant;

/// Builds a fresh copy of the committed sources, without any earlier build. Tests are built and not run.
pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    none(arguments)?;
    let place = root().join(format!("target/build-time-{}", std::process::id()));
    let measured = measure(&place);
    let removed = std::fs::remove_dir_all(&place).map_err(|error| Failed::at(&place, error));
    measured.and(removed)
}

fn measure(place: &Path) -> Result<(), Failed> {
    run(command("git").args(["clone", "--quiet", "."]).arg(place))?;
    // The time of downloads depends on the network, and is not measured.
    run(cargo_command(&["fetch"]).current_dir(place))?;
    let mut seconds = Vec::new();
    for arguments in [&["run", "--release"][..], &["test", "--no-run"]] {
        let begun = Instant::now();
        // Without this variable cargo builds into the copy's own target folder.
        run(cargo_command(arguments).current_dir(place).env_remove("CARGO_TARGET_DIR"))?;
        seconds.push((arguments.join(" "), begun.elapsed().as_secs()));
    }
    let tree = ["tree", "--edges", "normal,build", "--prefix", "none", "--format", "{p}", "--no-dedupe"];
    let crates = output(cargo_command(&tree).current_dir(place))?;
    let crates: BTreeSet<&str> = crates.lines().filter(|line| !line.is_empty()).collect();
    println!("\ncrates in the default build: {}", crates.len());
    for (command, seconds) in seconds {
        println!("cargo {command}: {seconds} s");
    }
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    println!("on {cores} cores, without an earlier build; in this order, in one folder");
    Ok(())
}
