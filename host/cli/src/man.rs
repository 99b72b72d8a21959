//! Implements the command `motor-hub man`.

use crate::output::{Failure, Files, Folder, print_paths};
use clap::Command;
use clap_mangen::Man;
use std::path::PathBuf;

/// Write the manual pages of all commands
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Folder for the pages
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/man")]
    out: PathBuf,
}

impl Options {
    pub(crate) fn execute(self, mut command: Command) -> Result<(), Failure> {
        let folder = Folder::new(&self.out)?;
        command.build();
        let mut pages = Files::new();
        draw(&command, &mut pages)?;
        print_paths(&folder.write_all(pages)?)
    }
}

/// Adds the manual page of a command and the pages of its subcommands.
fn draw(command: &Command, pages: &mut Files) -> Result<(), Failure> {
    let mut page = Vec::new();
    let man = Man::new(command.clone());
    man.render(&mut page).map_err(Failure::work)?;
    pages.push((man.get_filename(), page));
    command
        .get_subcommands()
        .filter(|inner| inner.get_name() != "help")
        .try_for_each(|inner| draw(inner, pages))
}
