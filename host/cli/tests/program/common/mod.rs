//! The program, and a place for what it writes.

use crate::conformance::Hub;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::{Mutex, MutexGuard, PoisonError};

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_motor-hub");

/// Runs the program to its end.
pub(crate) fn motor_hub(arguments: &[&str]) -> Output {
    Command::new(PROGRAM).args(arguments).output().expect("it can be started")
}

/// The simulated hub, served over TCP.
pub(crate) fn served() -> Hub {
    Hub::start(PROGRAM, &["--tcp", "127.0.0.1:0"])
}

/// Runs `client` to its end, for a hub on a TCP port or a pseudo-terminal.
pub(crate) fn client(hub: &Hub, arguments: &[&str]) -> Output {
    let line = if hub.place.contains(':') { "--tcp" } else { "--port" };
    motor_hub(&[&["client", line, &hub.place], arguments].concat())
}

/// Sends a signal, such as `-INT`, to a process.
#[cfg(unix)]
pub(crate) fn signal(process: u32, signal: &str) {
    assert!(Command::new("kill").args([signal, &process.to_string()]).status().expect("kill").success());
}

/// A folder of its own for each test, empty.
pub(crate) fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

/// Writes a file to a folder, which is made if there is none. Returns its path.
pub(crate) fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> String {
    std::fs::create_dir_all(folder).expect("a folder");
    let file = folder.join(name);
    std::fs::write(&file, content).expect("a file");
    file.display().to_string()
}

/// One such test at a time: what is measured in real time must not wait for another browser, nor for an emulated chip.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}
