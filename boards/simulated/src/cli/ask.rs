//! `motor-hub points` and `motor-hub map`: questions to the firmware's core.

use super::{Failure, print, print_json};
use crate::catalogue::find_motor;
use crate::operating::{OperatingReport, PlacedDrive};
use crate::report::{drawn, write_all};
use crate::scheme::{BlendChoice, SchemeName};
use crate::table;
use motor_hub::units::Control;
use std::path::PathBuf;

/// A motor at a speed on a battery, and how control values are given their meaning.
#[derive(clap::Args)]
struct OperatingOptions {
    /// Scheme of the motor
    #[arg(long, ignore_case = true)]
    scheme: SchemeName,
    /// Blend of scheme D: 0 (as B) to 1 (as C), or auto
    #[arg(long, value_name = "0..1|auto")]
    blend: Option<BlendChoice>,
    /// Motor of the catalogue
    #[arg(long, value_name = "NAME")]
    motor: String,
    /// Speed of the encoder in counts per second, positive for CW
    #[arg(long, value_name = "V", allow_negative_numbers = true)]
    #[arg(value_parser = clap::value_parser!(i32).range(-1_000_000..=1_000_000))]
    speed_cps: i32,
    /// Battery voltage in millivolts
    #[arg(long, value_name = "MV", value_parser = clap::value_parser!(u16).range(1..))]
    battery_mv: u16,
    /// JSON instead of a table
    #[arg(long)]
    json: bool,
}

impl OperatingOptions {
    fn report(&self) -> Result<OperatingReport, Failure> {
        let scheme = self.scheme.with_blend(self.blend).map_err(|e| Failure::Input(e.to_owned()))?;
        let motor = find_motor(&self.motor).map_err(Failure::Input)?;
        OperatingReport::new(motor, scheme, self.speed_cps, self.battery_mv).map_err(Failure::Input)
    }
}

/// Options of `points`.
#[derive(clap::Args)]
pub(super) struct PointsOptions {
    #[command(flatten)]
    at: OperatingOptions,
    /// Also draws the points, as SVG and PNG in this folder
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
}

impl PointsOptions {
    pub(super) fn execute(self) -> Result<(), Failure> {
        let report = self.at.report()?;
        if let Some(folder) = &self.plot {
            let figure = [("points".to_owned(), report.figure())];
            drawn(&figure).and_then(|files| write_all(folder, files)).map_err(Failure::Work)?;
        }
        if self.at.json {
            return print_json(&report);
        }
        let mut table = table::new(&["point", "control, counts", report.ordinate()], 0);
        for point in &report.points {
            let (x, y) = (format!("{:.2}", point.control), format!("{:.4}", point.y));
            table.add_row([point.name.to_owned(), x, y]);
        }
        let folder = self.plot.map(|f| format!("The chart is in {}\n", f.display())).unwrap_or_default();
        print(&format!("{}\n{table}\n{folder}", report.heading()))
    }
}

/// Options of `map`.
#[derive(clap::Args)]
pub(super) struct MapOptions {
    #[command(flatten)]
    at: OperatingOptions,
    /// Control value
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    #[arg(value_parser = clap::value_parser!(i16).range(-32767..))]
    control: i16,
}

impl MapOptions {
    pub(super) fn execute(self) -> Result<(), Failure> {
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
        print(&format!("{}, control {}\n{table}\n", report.heading(), placed.control))
    }
}
