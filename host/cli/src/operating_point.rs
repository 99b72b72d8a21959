//! Options of `points` and `map` that choose an operating point.

use crate::constants::Constants;
use crate::output::Failure;
use crate::parse::{battery_mv, named, whole};
use crate::scheme_options::{SCHEMES, scheme};
use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::characterised;
use simulated::scheme::BlendChoice;
use studies::points::OperatingReport;

/// A motor at a speed on a battery, and the scheme of control values.
#[derive(clap::Args)]
pub(crate) struct OperatingOptions {
    /// Scheme: the meaning of control values
    #[arg(long, ignore_case = true, value_parser = named(SCHEMES))]
    scheme: Scheme,
    /// Blend of scheme D: 0 (as B) to 1 (as C), or auto
    #[arg(long, value_name = "0..1|auto")]
    blend: Option<BlendChoice>,
    /// Motor of the catalogue: see `motor-hub motors`
    #[arg(long, value_name = "NAME", conflicts_with_all = ["ke", "resistance_ohm", "inductance_mh"])]
    motor: Option<String>,
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
    pub(crate) json: bool,
}

impl OperatingOptions {
    /// Computes the points S, T, Z and G at the operating point by the firmware's core.
    pub(crate) fn report(&self) -> Result<OperatingReport, Failure> {
        let scheme = scheme(self.scheme, self.blend)?;
        let motor = match &self.motor {
            Some(name) => characterised(name).map_err(Failure::input)?,
            None => self.constants.motor()?,
        };
        OperatingReport::new(motor, scheme, self.speed_cps, self.battery_mv).map_err(Failure::input)
    }
}
