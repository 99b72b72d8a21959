//! Files of `docs` that a task makes. With `--check` the task only says which files are stale.

use crate::tool::{Failed, root};
use std::fs;

/// The files that one task makes.
pub(crate) struct Generated {
    task: &'static str,
    check: bool,
    count: usize,
    stale: Vec<String>,
}

impl Generated {
    /// Reads the task's arguments: `--check` or nothing.
    pub(crate) fn new(task: &'static str, arguments: &[String]) -> Result<Self, Failed> {
        let check = match arguments {
            [] => false,
            [argument] if argument == "--check" => true,
            _ => return Err(Failed(format!("{task} takes --check or nothing"))),
        };
        Ok(Self { task, check, count: 0, stale: Vec::new() })
    }

    /// Compares a file with the content that it should have, and writes the content if they differ. With `--check` it only notes
    /// that the file is stale. The path `file` is relative to the root of the workspace. A missing file is stale too.
    pub(crate) fn take(&mut self, file: &str, content: &[u8]) -> Result<(), Failed> {
        let place = root().join(file);
        self.count += 1;
        if fs::read(&place).is_ok_and(|shown| shown == content) {
            return Ok(());
        }
        self.stale.push(file.to_owned());
        if self.check {
            Ok(())
        } else {
            fs::write(&place, content).map_err(|error| Failed::at(&place, error))
        }
    }

    /// Prints the result. Stale files fail a check.
    pub(crate) fn end(self) -> Result<(), Failed> {
        let stale = self.stale.join(", ");
        match (self.check, self.stale.is_empty()) {
            (_, true) => println!("{}: all {} files are fresh", self.task, self.count),
            (false, false) => println!("written: {stale}"),
            (true, false) => {
                return Err(Failed(format!("stale: {stale}; `cargo xtask {}` writes them", self.task)));
            }
        }
        Ok(())
    }
}
