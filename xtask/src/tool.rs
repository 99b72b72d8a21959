//! Functions that run other programs at the root of the workspace.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Prefix of the names of tests that only print, and are ignored for that reason. `--skip` leaves out every test whose
/// path contains this text, not only at its beginning.
pub(crate) const REPORTS: &str = "report_";

/// Why a task has failed.
pub(crate) struct Failed(pub(crate) String);

impl Failed {
    /// Creates the error for a file or folder that could not be used.
    pub(crate) fn at(path: &Path, error: std::io::Error) -> Self {
        Self(format!("{}: {error}", path.display()))
    }
}

/// Returns the root of the workspace.
pub(crate) fn root() -> PathBuf {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().unwrap_or(here).to_path_buf()
}

/// Returns the folder that cargo builds into.
pub(crate) fn target_folder() -> PathBuf {
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from)
}

/// Creates a command that runs at the root of the workspace.
pub(crate) fn command(program: impl AsRef<OsStr>) -> Command {
    let mut command = Command::new(program);
    command.current_dir(root());
    command
}

/// Prints a command, and runs it to its end. Fails if the exit code is not 0.
pub(crate) fn run(command: &mut Command) -> Result<(), Failed> {
    let name = command.get_program().to_string_lossy().into_owned();
    let arguments = command.get_args().map(|argument| format!(" {}", argument.to_string_lossy()));
    // Only the file name of a program is printed, not its path.
    let shown = Path::new(&name).file_name().unwrap_or_default().to_string_lossy();
    let shown = format!("{shown}{}", arguments.collect::<String>());
    println!("> {shown}");
    let status = command.status().map_err(|error| Failed(format!("{name}: {error}")))?;
    if status.success() { Ok(()) } else { Err(Failed(format!("{shown}: {status}"))) }
}

/// Runs a command, and returns its standard output. Fails if the exit code is not 0.
pub(crate) fn output(command: &mut Command) -> Result<String, Failed> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| Failed(format!("{name}: {error}")))?;
    if !output.status.success() {
        return Err(Failed(format!("{name}: {}", String::from_utf8_lossy(&output.stderr).trim_end())));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Creates a command of the cargo that runs this task.
pub(crate) fn cargo_command(arguments: &[&str]) -> Command {
    let mut cargo = command(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(arguments);
    cargo
}

/// Runs cargo.
pub(crate) fn cargo(arguments: &[&str]) -> Result<(), Failed> {
    run(&mut cargo_command(arguments))
}

/// Runs the program motor-hub with emulated chips, and builds it first if needed. The features of its crates are those in the tests
/// of images, so both use the same crates.
pub(crate) fn motor_hub(arguments: &[&str]) -> Result<(), Failed> {
    let program = ["run", "--release", "--quiet", "--features", "emulated,motor-hub/signed", "--"];
    cargo(&[&program[..], arguments].concat())
}

/// Builds the program motor-hub and the library as `cargo test` builds them. Returns the program.
pub(crate) fn tested_program() -> Result<PathBuf, Failed> {
    cargo(&["test", "--no-run", "--quiet", "--test", "program"])?;
    Ok(target_folder().join("debug/motor-hub"))
}

/// Returns the path of a tool in the toolchain's component llvm-tools.
pub(crate) fn llvm(tool: &str) -> Result<PathBuf, Failed> {
    let sysroot = output(command("rustc").args(["--print", "sysroot"]))?;
    let about = output(command("rustc").arg("-vV"))?;
    let host = about.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.ok_or_else(|| Failed("rustc does not name its host".to_owned()))?;
    Ok(Path::new(sysroot.trim()).join("lib/rustlib").join(host).join("bin").join(tool))
}

/// Refuses arguments of a task that takes none.
pub(crate) fn none(arguments: &[String]) -> Result<(), Failed> {
    match arguments.first() {
        None => Ok(()),
        Some(argument) => Err(Failed(format!("this task takes no arguments; given: {argument}"))),
    }
}
