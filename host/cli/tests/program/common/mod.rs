//! The program, and a place for what it writes.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, MutexGuard, PoisonError};

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_motor-hub");

/// Runs the program to its end.
pub(crate) fn motor_hub(arguments: &[&str]) -> Output {
    Command::new(PROGRAM).args(arguments).output().expect("it can be started")
}

/// Runs `client` to its end, for the hub at a TCP address.
#[allow(dead_code, reason = "the tests of images use serial ports")]
pub(crate) fn client(place: &str, arguments: &[&str]) -> Output {
    motor_hub(&[&["client", "--tcp", place], arguments].concat())
}

/// Sends a signal, such as `-INT`, to a process.
#[cfg(unix)]
#[allow(dead_code, reason = "the tests of images send none")]
pub(crate) fn signal(process: u32, signal: &str) {
    assert!(Command::new("kill").args([signal, &process.to_string()]).status().expect("kill").success());
}

/// A folder of its own for each test, empty.
pub(crate) fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

/// One such test at a time: what is measured in real time must not wait for another browser, nor for an emulated chip.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}
