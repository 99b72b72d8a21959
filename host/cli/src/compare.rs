//! `motor-hub compare`.

use crate::output::{Failure, Folder, drawn, print, print_json, progress};
use std::path::PathBuf;
use studies::compare::Comparison;

/// The long help of the command.
pub(crate) const HELP: &str = "\
The same tasks under every scheme, with linear duty and with linear current

The motor is a NeveRest 60 with a 10 kg flywheel. Tasks: a step down, a load that drives the motor, a \
reversal, a crawl, a load at standstill, a sagging battery, the step with another flywheel, and the step with \
R or Ke configured wrong. Variants: no braking regime (forward and reverse driving only) and schemes A to D \
(D with automatic blend), each with linear duty, as in the paper, and with linear current. PID runs twice: \
with the same PI coefficients for all, and with each variant's best of a small grid, chosen on the first task. \
The motor's model has no coefficients.

The output begins with the winner and the tasks at which another variant is better. The folder gets the charts, \
and the tables as Markdown in tables.md.";

/// Options of `compare`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Run only the first three tasks, with the same coefficients for all
    #[arg(long)]
    quick: bool,
    /// Folder for the charts and tables.md
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/compare")]
    out: PathBuf,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let folder = Folder::new(&self.out)?;
        let bar = progress(None, "runs");
        let mut progress = |done: usize, total: usize| {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        };
        let comparison = Comparison::new(self.quick, &mut progress).map_err(Failure::work)?;
        bar.finish_and_clear();
        let draw = || {
            let mut files = drawn(&comparison.figures());
            files.push(("tables.md".to_owned(), comparison.markdown().into_bytes()));
            folder.write_all(files)
        };
        if self.json {
            return print_json(&comparison.json(&draw()?));
        }
        print(&comparison.text())?;
        draw()?;
        print(&format!("Charts (SVG) and tables (Markdown) are in {folder}\n"))
    }
}
