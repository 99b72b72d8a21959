//! Implements the command `motor-hub paper`.

use crate::output::{Failure, print, print_json};
use studies::paper::Document;

/// Compare every number that the paper prints with ours, and list its misprints
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let document = Document::new().map_err(Failure::work)?;
        if self.json { print_json(&document) } else { print(&document.text()) }
    }
}
