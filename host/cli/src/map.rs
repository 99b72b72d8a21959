//! Implements the command `motor-hub map`.

use crate::operating_point::OperatingOptions;
use crate::output::{Failure, print, print_json};
use crate::parse::{share, whole};
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
pub(crate) struct Options {
    #[command(flatten)]
    at: OperatingOptions,
    #[command(flatten)]
    control: ControlOptions,
}

/// A control value in one of two units.
#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct ControlOptions {
    /// Control value as a fraction of full scale, -1 to 1
    #[arg(long, value_name = "FRACTION", value_parser = fraction)]
    control: Option<Control>,
    /// Control value in steps of the protocol, -32767 to 32767
    #[arg(long, value_name = "STEPS")]
    #[arg(value_parser = whole("a control value", -32_767..=i16::MAX, "steps"))]
    control_steps: Option<i16>,
}

impl ControlOptions {
    /// Returns the control value. The parser makes sure that one of the options is given.
    fn value(&self) -> Control {
        self.control.or(self.control_steps.map(Control::new)).unwrap_or_default()
    }
}

fn fraction(text: &str) -> Result<Control, &'static str> {
    share(text).ok_or("a control value is a number from -1 to 1; give steps by --control-steps")
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let report = self.at.report()?;
        let placed = report.place(self.control.value());
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
