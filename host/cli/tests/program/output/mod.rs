//! What a run of the program printed.

use serde_json::Value;
use std::process::Output;

/// Standard output of a run that succeeded.
#[track_caller]
pub(crate) fn out(output: &Output) -> String {
    assert!(output.status.success(), "{}", err(output));
    String::from_utf8(output.stdout.clone()).unwrap()
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
    assert!(code != 2 || output.stdout.is_empty(), "{says}: {}", String::from_utf8_lossy(&output.stdout));
}
