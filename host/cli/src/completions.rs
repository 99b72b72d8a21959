//! Implements the command `motor-hub completions`.

use crate::output::{Failure, print};
use clap::Command;
use clap_complete::Shell;

/// Print a script with which a shell completes commands and options
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Shell that completes commands
    #[arg(value_name = "SHELL", ignore_case = true)]
    shell: Shell,
}

impl Options {
    pub(crate) fn execute(self, mut command: Command) -> Result<(), Failure> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut command, "motor-hub", &mut script);
        print(&String::from_utf8(script).map_err(Failure::work)?)
    }
}
