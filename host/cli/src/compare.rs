//! Implements the command `motor-hub compare`.

use crate::output::{Failure, Folder, drawn, in_steps};
use std::path::PathBuf;
use studies::compare::Comparison;

/// Compare the schemes, with linear duty and with linear current, at the same tasks
///
/// The motor is a NeveRest 60 with a 10 kg flywheel. Tasks: a step down, a load that drives the motor, a reversal, a
/// crawl, a load at standstill, a sagging battery, the step with another flywheel, and the step with R or Ke
/// configured wrong. Variants: no braking regime (forward and reverse driving only) and schemes A to D (D with
/// automatic blend), each with linear duty, as in the paper, and with linear current. PID runs twice: with the same
/// PI coefficients for all, and with each variant's best of a small grid, chosen on the first task. The motor's model
/// has no coefficients.
///
/// The output begins with the winner and the tasks at which another variant is better. The folder gets the charts,
/// and the tables as Markdown in tables.md.
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
        let comparison = in_steps("runs", |step| Comparison::new(self.quick, step)).map_err(Failure::work)?;
        let mut files = drawn(&comparison.figures());
        files.push(("tables.md".to_owned(), comparison.markdown().into_bytes()));
        let json = self.json.then_some(|files: &[String]| comparison.json(files));
        folder.publish(files, "Charts (SVG) and tables (Markdown) are", &comparison.text(), json)
    }
}
