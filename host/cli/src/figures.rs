//! `motor-hub figures`.

use crate::output::{Failure, drawn, print, write_all};
use std::path::PathBuf;

/// Options of `figures`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder for the figures
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/figures")]
    out: PathBuf,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let figures = studies::figures::all().map_err(Failure::work)?;
        let files = write_all(&self.out, drawn(&figures)?)?;
        print(&files.iter().map(|file| format!("{}\n", file.display())).collect::<String>())
    }
}
