//! Implements the commands `motor-hub points` and `motor-hub map`, which compute what the firmware does at an operating
//! point.

use crate::constants::Constants;
use crate::output::{Failure, Folder, drawn, print, print_json};
use crate::parse::{battery_mv, named, share, whole};
use crate::scheme_options::{SCHEMES, scheme};
use clap::ArgGroup;
use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::units::Control;
use simulated::scheme::BlendChoice;
use std::path::PathBuf;
use studies::points::{OperatingReport, PlacedDrive};
use studies::table;

/// A motor at a speed on a battery, and the scheme of control values.
#[derive(clap::Args)]
struct OperatingOptions {
    /// Scheme: the meaning of control values
    #[arg(long, ignore_case = true, value_parser = named(SCHEMES))]
    scheme: Scheme,
    /// Blend of scheme D: 0 (as B) to 1 (as C), or auto
    #[arg(long, value_name = "0..1|auto")]
    blend: Option<BlendChoice>,
    /// Motor of the catalogue: see `motor-hub motors`
    #[arg(long, value_name = "NAME", conflicts_with_all = ["ke", "resistance_ohm", "inductance_mh"])]
    #[arg(value_parser = characterised)]
    motor: Option<Motor>,
    #[command(flatten)]
    constants: Constants,
    /// Speed of the encoder in counts per second, positive for CW
    #[arg(long, value_name = "CPS", value_parser = whole("a speed", -1_000_000..=1_000_000, "counts/s"))]
    speed_cps: i32,
    /// Battery voltage in millivolts
    #[arg(long, value_name = "MV", value_parser = battery_mv)]
    battery_mv: u16,
    /// Print one JSON document instead of a table
    #[arg(long)]
    json: bool,
}

impl OperatingOptions {
    /// Computes the points S, T, Z and G at the operating point by the firmware's core.
    fn report(&self) -> Result<OperatingReport, Failure> {
        let scheme = scheme(self.scheme, self.blend)?;
        let motor = self.motor.map_or_else(|| self.constants.motor(), Ok)?;
        OperatingReport::new(motor, scheme, self.speed_cps, self.battery_mv).map_err(Failure::input)
    }
}

/// Usage of the command in lines of at most 80 columns.
pub(crate) const POINTS_USAGE: &str = "\
motor-hub points [OPTIONS] --scheme <SCHEME>
           --speed-cps <CPS> --battery-mv <MV>";

/// Compute the points S, T, Z, G at an operating point with the firmware's core
#[derive(clap::Args)]
pub(crate) struct PointsOptions {
    #[command(flatten)]
    at: OperatingOptions,
    /// Also draw the points, as SVG in this folder
    #[arg(long, value_name = "DIR")]
    plot: Option<PathBuf>,
}

impl PointsOptions {
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

/// Usage of the command in lines of at most 80 columns.
pub(crate) const MAP_USAGE: &str = "\
motor-hub map [OPTIONS] --scheme <SCHEME>
           --speed-cps <CPS> --battery-mv <MV>
           <--control <FRACTION>|--control-steps <STEPS>>";

/// Compute regime, mode and duty of a control value at an operating point
#[derive(clap::Args)]
#[command(group(ArgGroup::new("value").required(true)))]
pub(crate) struct MapOptions {
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

impl MapOptions {
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
