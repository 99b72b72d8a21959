//! `motor-hub compare`.

use crate::output::{Failure, Folder, drawn, print, print_json, progress};
use std::path::PathBuf;
use studies::compare::Comparison;

/// The long help of the command.
pub(crate) const HELP: &str = "\
The same tasks under every scheme, with linear duty and with linear current

An AM 60 A with a 10 kg flywheel steps down, is driven by its load, reverses, crawls, holds a load at \
standstill, works from a sagging battery, and steps down with another flywheel or while the hub is wrong \
about R or Ke; under forward and reverse driving only (none) and under schemes A to D (D with automatic \
blend), each with linear duty, as in the paper, and with linear current. By PID twice: with the same PI \
coefficients for all, and with each variant's best of a small grid, chosen on the first task; and by the \
motor's model, which has no coefficients.";

/// Options of `compare`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only the first three tasks, with the same coefficients for all
    #[arg(long)]
    quick: bool,
    /// Folder for the charts
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/compare")]
    out: PathBuf,
    /// One JSON document on standard output instead of tables
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
        let draw = || folder.write_all(drawn(&comparison.figures()));
        if self.json {
            return print_json(&comparison.json(&draw()?));
        }
        print(&comparison.text())?;
        draw()?;
        print(&format!("\nCharts (SVG) are in {folder}\n"))
    }
}
