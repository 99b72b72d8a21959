//! Runs the program, and reads what the program prints. Folders and files for tests, and waiting.

use crate::conformance::Hub;
use serde_json::Value;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_motor-hub");

/// Longest wait for anything; a machine may have other work.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// Runs the program to its end.
pub(crate) fn motor_hub(arguments: &[&str]) -> Output {
    Command::new(PROGRAM).args(arguments).output().expect("the program starts")
}

/// Runs `client` to its end, for a hub on a TCP port or a pseudo-terminal.
pub(crate) fn client(hub: &Hub, arguments: &[&str]) -> Output {
    let line = if hub.place.contains(':') { "--tcp" } else { "--port" };
    motor_hub(&[&["client", line, &hub.place], arguments].concat())
}

/// Runs the program to its end. It cannot write a file beyond this length, as on a full disk.
pub(crate) fn motor_hub_with_files_of(kib: u32, arguments: &[&str]) -> Output {
    let limited = format!("trap '' XFSZ; ulimit -f {kib}; exec \"$@\"");
    let mut shell = Command::new("bash");
    shell.args(["-c", &limited, "bash", PROGRAM]).args(arguments).output().expect("the program starts")
}

/// Starts `client` for a hub on a TCP port.
pub(crate) fn start_client(place: &str, arguments: &[&str]) -> Child {
    let mut command = Command::new(PROGRAM);
    command.args(["client", "--tcp", place]).args(arguments);
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("the program starts")
}

/// Starts `client` for a hub on a TCP port, and returns the process once it has printed a line: then a motor is enabled, or
/// an output is on.
pub(crate) fn driving(hub: &Hub, arguments: &[&str]) -> Child {
    let mut process = start_client(&hub.place, arguments);
    let mut printed = BufReader::new(process.stdout.as_mut().expect("standard output"));
    printed.read_line(&mut String::new()).expect("a line");
    process
}

/// Runs `client scan` for these places, and for hubs that have left a note in a folder. The serial ports of this machine are not
/// scanned. A row of the table has one line also for a long path.
pub(crate) fn scan(notes: &Path, arguments: &[&str]) -> Output {
    let mut scan = Command::new(PROGRAM);
    scan.args(["client", "--timeout-ms", "500", "scan", "--only"]).args(arguments);
    scan.env("XDG_RUNTIME_DIR", notes).env("COLUMNS", "300").output().expect("the program starts")
}

/// A text with one space between words.
pub(crate) fn words(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Sends a signal, such as `-INT`, to a process.
pub(crate) fn signal(process: u32, signal: &str) {
    assert!(Command::new("kill").args([signal, &process.to_string()]).status().expect("kill").success());
}

/// Waits until `look` finds something, and returns it.
pub(crate) fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + PATIENCE;
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(Instant::now() < end, "never: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The path of a folder for one test. The folder does not exist.
pub(crate) fn folder(test: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    let _ = std::fs::remove_dir_all(&folder);
    folder
}

/// An empty folder for one test.
pub(crate) fn made_folder(test: &str) -> PathBuf {
    let folder = folder(test);
    std::fs::create_dir_all(&folder).expect("a folder");
    folder
}

/// The path of a file for a hub's stored settings, in an empty folder. The file does not exist.
pub(crate) fn store(test: &str) -> String {
    made_folder(test).join("store").display().to_string()
}

/// Writes a file to a folder, which is made if there is none. Returns the path of the file.
pub(crate) fn write(folder: &Path, name: &str, content: impl AsRef<[u8]>) -> String {
    std::fs::create_dir_all(folder).expect("a folder");
    let file = folder.join(name);
    std::fs::write(&file, content).expect("a file");
    file.display().to_string()
}

/// Writes a scenario with a good battery, and with this text, to a folder for one test. Returns the path of the file.
pub(crate) fn scenario(test: &str, text: &str) -> String {
    let battery =
        if text.contains("battery") { "" } else { "battery = { emf_v = 12.6, resistance_ohm = 0.05 }" };
    let text = format!("name = \"{test}\"\nduration_s = 30\n{battery}\n{text}");
    write(&folder(test), "scenario.toml", text)
}

/// Options of `drive` for the base of tests.
pub(crate) const BASE: [&str; 6] =
    ["--wheel-diameter-mm", "90", "--track-mm", "300", "--counts-per-turn", "1680,1680"];

/// Waits for other tests that call this function. Times that are measured in real time must not include the work of another
/// browser or of an emulated chip.
pub(crate) fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Standard output.
#[track_caller]
pub(crate) fn printed(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// Standard output of a run that succeeded.
#[track_caller]
pub(crate) fn out(output: &Output) -> String {
    assert!(output.status.success(), "{}", err(output));
    printed(output)
}

/// Standard error.
#[track_caller]
pub(crate) fn err(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// The JSON document that a run printed which succeeded.
#[track_caller]
pub(crate) fn json(output: &Output) -> Value {
    serde_json::from_str(&out(output)).expect("standard output is one JSON document")
}

/// Expects an exit code, and words on standard error. Wrong options (exit code 2) print nothing on standard output.
#[track_caller]
pub(crate) fn fails(output: &Output, code: i32, says: &str) {
    let words = err(output);
    assert_eq!(output.status.code(), Some(code), "{says}: {words}");
    assert!(words.contains(says), "{says:?} is not in: {words}");
    assert!(code != 2 || output.stdout.is_empty(), "{says}: {}", printed(output));
}
