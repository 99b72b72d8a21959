//! Implements the command `motor-hub points`.

use crate::operating_point::OperatingOptions;
use crate::output::{Failure, Folder, drawn, print, print_json};
use std::path::PathBuf;
use studies::table;

/// Usage of the command in lines of at most 80 columns.
pub(crate) const USAGE: &str = "\
motor-hub points [OPTIONS] --scheme <SCHEME>
           --speed-cps <CPS> --battery-mv <MV>";

/// Compute the points S, T, Z, G at an operating point with the firmware's core
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    at: OperatingOptions,
    /// Also draw the points, as SVG in this folder
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let report = self.at.report()?;
        let folder = self.plot.as_deref().map(Folder::new).transpose()?;
        let draw = || -> Result<(), Failure> {
            let Some(folder) = &folder else { return Ok(()) };
            folder.write_all(drawn(&[("points".to_owned(), report.figure())])).map(drop)
        };
        if self.at.json {
            print_json(&report)?;
            return draw();
        }
        let mut table = table::new(&["point", "control, steps", report.ordinate()], 0);
        for point in &report.points {
            let (x, y) = (format!("{:.2}", point.control), format!("{:.4}", point.y));
            table.add_row([point.name.to_owned(), x, y]);
        }
        print(&format!("{}\n{table}\n", table::paragraph(&report.heading())))?;
        draw()?;
        folder.map_or(Ok(()), |folder| print(&format!("The chart is in {folder}\n")))
    }
}
