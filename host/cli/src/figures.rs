//! Implements the command `motor-hub figures`.

use crate::output::{Failure, Folder, drawn, print_paths};
use std::path::PathBuf;

/// Draw the paper's figures, and the currents of control values, as SVG
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder for the figures
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/figures")]
    out: PathBuf,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let folder = Folder::new(&self.out)?;
        let figures = studies::figures::all().map_err(Failure::work)?;
        let circuits = studies::figures::circuits();
        let mut files = drawn(&figures);
        files.push(("14-circuits.svg".into(), circuits.into_bytes()));
        print_paths(&folder.write_all(files)?)
    }
}
