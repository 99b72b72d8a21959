//! `motor-hub points`.

use crate::operating::OperatingOptions;
use crate::output::{Failure, drawn, print, print_json, write_all};
use std::path::PathBuf;
use studies::table;

/// Options of `points`.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    at: OperatingOptions,
    /// Also draws the points, as SVG and PNG in this folder
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let report = self.at.report()?;
        if let Some(folder) = &self.plot {
            let figure = [("points".to_owned(), report.figure())];
            write_all(folder, drawn(&figure)?)?;
        }
        if self.at.json {
            return print_json(&report);
        }
        let mut table = table::new(&["point", "control, steps", report.ordinate()], 0);
        for point in &report.points {
            let (x, y) = (format!("{:.2}", point.control), format!("{:.4}", point.y));
            table.add_row([point.name.to_owned(), x, y]);
        }
        let folder = self.plot.map(|f| format!("The chart is in {}\n", f.display())).unwrap_or_default();
        print(&format!("{}\n{table}\n{folder}", report.heading()))
    }
}
