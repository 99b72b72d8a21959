//! Implements the command `motor-hub map`.

use crate::operating_point::OperatingOptions;
use crate::output::{Failure, print, print_json};
use crate::parse::{share, whole};
use clap::ArgGroup;
use motor_hub::units::Control;
use studies::points::PlacedDrive;
use studies::table;

/// Usage of the command in lines of at most 80 columns.
pub(crate) const USAGE: &str = "\
motor-hub map [OPTIONS] --scheme <SCHEME>
           --speed-cps <CPS> --battery-mv <MV>
           <--control <FRACTION>|--control-steps <STEPS>>";

/// Compute regime, mode and duty of a control value at an operating point
#[derive(clap::Args)]
#[command(group(ArgGroup::new("value").required(true)))]
pub(crate) struct Options {
    #[command(flatten)]
    at: OperatingOptions,
    /// Control value as a fraction of full scale, -1 to 1
    #[arg(long, group = "value", value_name = "FRACTION", value_parser = fraction)]
    control: Option<Control>,
    /// Control value in steps of the protocol, -32767 to 32767
    #[arg(long, group = "value", value_name = "STEPS")]
    #[arg(value_parser = whole("a control value", -32_767..=i16::MAX, "steps"))]
    control_steps: Option<i16>,
}

fn fraction(text: &str) -> Result<Control, &'static str> {
    share(text).ok_or("a control value is a number from -1 to 1; give steps by --control-steps")
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let report = self.at.report()?;
        // The group makes sure that one of the two options is given.
        let control = self.control.or(self.control_steps.map(Control::new)).unwrap_or_default();
        let placed = report.place(control);
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
        let heading = format!(
            "{}, control {:.4} ({} steps)",
            report.heading(),
            f64::from(placed.control) / f64::from(Control::MAX.get()),
            placed.control
        );
        print(&format!("{}\n{table}\n", table::paragraph(&heading)))
    }
}
