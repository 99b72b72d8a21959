//! `motor-hub map`.

use crate::operating::OperatingOptions;
use crate::output::{Failure, print, print_json};
use crate::parse::whole;
use motor_hub::units::Control;
use studies::points::PlacedDrive;
use studies::table;

/// In two lines: a terminal has 80 columns.
pub(crate) const USAGE: &str = "\
motor-hub map [OPTIONS] --scheme <SCHEME>
           --speed-cps <V> --battery-mv <MV> --control-steps <STEPS>";

/// Options of `map`.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    at: OperatingOptions,
    /// Control value
    #[arg(long = "control-steps", alias = "control", value_name = "STEPS")]
    #[arg(value_parser = whole("a control value", -32_767..=i16::MAX, "steps"))]
    control: i16,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let report = self.at.report()?;
        let placed = report.place(Control::new(self.control));
        if self.at.json {
            return print_json(&placed);
        }
        let mut table = table::new(&["rule", "regime", "mode", "duty"], 1);
        for (rule, PlacedDrive { regime, mode, duty }) in [
            ("duty linear, as in the paper", &placed.linear_duty),
            ("current linear", &placed.linear_current),
        ] {
            table.add_row([rule.to_owned(), (*regime).into(), (*mode).into(), format!("{duty:.5}")]);
        }
        let heading = format!("{}, control {}", report.heading(), placed.control);
        print(&format!("{}\n{table}\n", table::paragraph(&heading)))
    }
}
