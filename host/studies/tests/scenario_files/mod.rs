//! The scenarios in `tests/scenarios`, at the root of the repository.

use simulated::scenario::Scenario;
use std::path::Path;
use studies::expectations::Verdict;

/// Returns all scenarios with their file names, in the order of the names.
pub(crate) fn all() -> Vec<(String, Scenario)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/scenarios");
    let entries = std::fs::read_dir(folder).expect("the folder exists");
    let mut files: Vec<_> = entries.map(|entry| entry.expect("it can be listed").path()).collect();
    files.sort();
    assert!(!files.is_empty());
    let load = |path: &std::path::PathBuf| {
        let scenario = Scenario::load(path).unwrap_or_else(|error| panic!("{error}"));
        (path.file_name().unwrap_or_default().to_string_lossy().into_owned(), scenario)
    };
    files.iter().map(load).collect()
}

/// A line for each expectation that a run did not meet.
pub(crate) fn unmet(file: &str, verdicts: &[Verdict]) -> Vec<String> {
    let unmet = verdicts.iter().filter(|verdict| !verdict.met());
    unmet.map(|verdict| format!("{file}: {verdict}")).collect()
}
