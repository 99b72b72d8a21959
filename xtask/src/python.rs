//! `cargo xtask python`: builds the Python package, installs it into an environment of its own, and tests it.

use crate::tool::{Failed, cargo_command, none, root, run, tested_program};
use std::path::{Path, PathBuf};
use std::process::Command;

/// The package, from the project's folder.
const PACKAGE: &str = "host/python";

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    none(arguments)?;
    // The tests start the program motor-hub, which serves a simulated hub.
    let program = tested_program()?;
    let target = root().join("target");
    let wheels = target.join("wheels");
    wheel(&wheels)?;
    let python = environment("python", &["pandas", "matplotlib", "mypy", "mcap"])?;
    run(install(&python).args(["--no-index", "motor-hub", "--find-links"]).arg(&wheels))?;
    // The package is tested as installed: its sources are not in the search path.
    run(Command::new(&python)
        .args(["-m", "mypy", "--strict", "--package", "motor_hub"])
        .current_dir(&target))?;
    run(Command::new(&python)
        .arg(root().join(PACKAGE).join("tests/test_motor_hub.py"))
        .env("MOTOR_HUB", program)
        .current_dir(&target))?;
    // This test reads a recording of the dashboard's page with the package mcap of PyPI.
    let recording = ["test", "--test", "program", "saved_as_mcap", "--", "--ignored"];
    run(cargo_command(&recording).env("MOTOR_HUB_MCAP", &python))
}

/// Builds the wheel for this kind of computer, and for every Python from 3.10 on, into a folder. An older wheel is replaced.
pub(crate) fn wheel(folder: &Path) -> Result<(), Failed> {
    let python = environment("maturin", &["maturin>=1.9,<2"])?;
    let manifest = root().join(PACKAGE).join("Cargo.toml");
    let mut build = Command::new(python.with_file_name("maturin"));
    run(build
        .args(["build", "--quiet", "--release", "--manifest-path"])
        .arg(manifest)
        .arg("--out")
        .arg(folder))
}

/// Makes an environment of Python in this folder of `target`, with packages of PyPI. Returns its interpreter.
pub(crate) fn environment(folder: &str, packages: &[&str]) -> Result<PathBuf, Failed> {
    let environment = root().join("target").join(folder);
    run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&environment))?;
    let python = environment.join("bin/python");
    run(install(&python).args(packages))?;
    Ok(python)
}

fn install(python: &Path) -> Command {
    let mut command = Command::new(python);
    command.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
    command
}
