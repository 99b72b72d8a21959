//! `motor-hub client drive` and `odometry`: a drive base with two wheels.

use super::hub::HubOptions;
use super::motors_off::DrivingSession;
use super::readings::repeat;
use super::together::{enable_with_power_0, run_group};
use crate::output::{Failure, print, print_as, print_error_line};
use crate::parse::{number, pair, within_a_day};
use motor_hub::extension::base::OdometryReport;
use motor_hub::group::{BaseSettings, DriveBase, GyroState};
use motor_hub::protocol::CHANNELS;
use motor_hub_client::Session;
use motor_hub_client::base::{OdometryValues, Part, heading_text, most_counts};
use std::time::Duration;

/// Longest wait for the first reading of the gyro. A BNO055 answers 0.65 s after power-on, and the hub tries to read it
/// once a second.
const GYRO_START: Duration = Duration::from_secs(3);
const POLL: Duration = Duration::from_millis(50);

/// Drives a base with two wheels along straight lines and through turns, then disables its motors, on hubs of this
/// project
///
/// The options that describe the base configure it, and the base then starts at the origin. Without these options the
/// command uses the base that the hub has, and the base continues from its present position. `settings save` stores
/// the base. The command fails (exit code 1) if the wheels make no progress for 5 s, for example because a wheel is held
/// fast.
///
/// The hub computes the position of the base: `odometry` shows the position afterwards. With --use-gyro the hub reads
/// a BNO055 on I2C bus 0, and the base holds the heading of the gyro, even if wheels slip or differ. If the gyro fails,
/// the base holds its heading by the encoders, and the command prints a warning.
#[derive(clap::Args)]
pub(super) struct Options {
    /// Parts of the course in their order: straight=MM, backward if negative, or turn=DEGREES, positive to the left
    #[arg(value_name = "PART", required = true, value_parser = part)]
    parts: Vec<Part>,
    /// Motors of the left and the right wheel
    #[arg(long, value_name = "LEFT,RIGHT", default_value = "0,1", value_parser = wheels, requires = "wheel_diameter_mm")]
    wheels: [u8; 2],
    /// Diameter of the wheels in mm [default: the base that the hub has]
    #[arg(long, value_name = "MM", value_parser = positive, requires_all = ["track_mm", "counts_per_turn"])]
    wheel_diameter_mm: Option<f64>,
    /// Distance between the centres of the wheels in mm
    #[arg(long, value_name = "MM", value_parser = positive, requires = "wheel_diameter_mm")]
    track_mm: Option<f64>,
    /// Encoder counts per turn of the left and the right wheel; negative if the motor counts down while its wheel drives forward
    #[arg(long, value_name = "LEFT,RIGHT", value_parser = counts_per_turn, allow_hyphen_values = true, requires = "wheel_diameter_mm")]
    counts_per_turn: Option<[f64; 2]>,
    /// The base holds the heading of the gyro on I2C bus 0
    #[arg(long, requires = "wheel_diameter_mm")]
    use_gyro: bool,
    /// Speed of the wheels in mm/s
    #[arg(long, value_name = "MM/S", default_value = "200", value_parser = positive)]
    speed_mm_per_s: f64,
    /// Largest acceleration of the wheels in mm/s²
    #[arg(long, value_name = "MM/S2", default_value = "400", value_parser = positive)]
    acceleration_mm_per_s2: f64,
    /// Longest duration of each part in seconds [default: no limit]
    #[arg(long = "for-s", value_name = "S", value_parser = within_a_day)]
    length: Option<Duration>,
}

fn part(text: &str) -> Result<Part, String> {
    let of = |number: &str| number.parse().ok().filter(|number: &f64| number.abs() <= 1e6);
    let part = match text.split_once('=') {
        Some(("straight", mm)) => of(mm).map(Part::Straight),
        Some(("turn", degrees)) => of(degrees).map(Part::Turn),
        _ => None,
    };
    part.ok_or_else(|| "a part is straight=MM or turn=DEGREES, each -1000000 to 1000000".to_owned())
}

fn positive(text: &str) -> Result<f64, String> {
    number("allowed", 0.001..=1e6, "")(text)
}

fn counts_per_turn(text: &str) -> Result<[f64; 2], &'static str> {
    let wheels = pair(text).filter(|wheels| wheels.iter().all(|counts: &f64| counts.is_finite()));
    wheels.ok_or("give two numbers, as 1680,-1680")
}

fn wheels(text: &str) -> Result<[u8; 2], String> {
    let wheels = pair(text).filter(|wheels| wheels.iter().all(|motor| usize::from(*motor) < CHANNELS));
    wheels.ok_or_else(|| format!("give two motors from 0 to {}, as 0,1", CHANNELS - 1))
}

impl Options {
    /// Returns the drive base that the options configure. `None` if the options give no dimensions; the command then
    /// uses the base in force.
    fn settings(&self) -> Result<Option<BaseSettings>, Failure> {
        let dimensions = self.wheel_diameter_mm.zip(self.track_mm).zip(self.counts_per_turn);
        let Some(((wheel_diameter_mm, track_mm), counts_per_turn)) = dimensions else { return Ok(None) };
        let base = DriveBase { wheel_diameter_mm, track_mm, counts_per_turn };
        let base = BaseSettings::new(self.wheels, &base, self.use_gyro);
        base.map(Some).map_err(Failure::input)
    }

    pub(super) fn execute(&self, hub: &HubOptions) -> Result<(), Failure> {
        let given = self.settings()?;
        let command = |base: &BaseSettings, from: [f64; 2], part: &Part| {
            part.command(base, from, self.speed_mm_per_s, self.acceleration_mm_per_s2).map_err(Failure::input)
        };
        let check = |base: &BaseSettings| {
            let (mut at, mut moves) = ([0.0; 2], false);
            for part in &self.parts {
                (at, _) = command(base, at, part)?;
                moves |= at.iter().any(|counts: &f64| counts.abs() >= 0.5);
            }
            let stays = self.parts.iter().all(|(Part::Straight(by) | Part::Turn(by))| *by == 0.0);
            if moves || stays { Ok(()) } else { Err(too_small(&base.geometry())) }
        };
        given.as_ref().map_or(Ok(()), check)?;
        let session = &mut hub.open(None)?;
        let base = match given {
            Some(base) => base,
            None => session.base_if_reported()?.ok_or_else(|| {
                Failure::input(
                    "the hub has no drive base; give --wheel-diameter-mm, --track-mm and --counts-per-turn once, and keep the base by \
                     `settings save`",
                )
            })?,
        };
        check(&base)?;
        let end = DrivingSession::run(session, |driven| {
            if given.is_some() {
                driven.set_base(base)?;
            }
            await_gyro(driven)?;
            let start = driven.odometry()?;
            let mut at = start.counts.map(f64::from);
            enable_with_power_0(driven, &base.wheels)?;
            // Earlier losses are not reported again. A gyro that is still lost is reported after the first part.
            let mut losses = if start.gyro == GyroState::Lost { 0 } else { start.losses };
            let mut is_implausible = false;
            for part in &self.parts {
                // Each part begins at the target positions of the part before, so that errors of the parts do not add
                // up.
                let (to, wanted) = command(&base, at, part)?;
                let what = match part {
                    Part::Straight(mm) => format!("straight={mm} not finished"),
                    Part::Turn(degrees) => format!("turn={degrees} not finished"),
                };
                run_group(driven, &base.wheels, wanted, self.length, &what)?;
                at = to;
                let report = driven.odometry()?;
                if report.losses != losses {
                    losses = report.losses;
                    print_error_line(
                        "warning: the gyro was lost; the base has held its heading by its encoders",
                    );
                }
                if report.gyro == GyroState::Implausible && !is_implausible {
                    is_implausible = true;
                    print_error_line(
                        "warning: the gyro did not turn with the wheels; the base holds its heading by its encoders. Mount the sensor \
                         with its chip upward, and check left and right, and the signs of the counts per turn",
                    );
                }
            }
            Ok(driven.odometry()?)
        })?;
        print(&format!("{}\n", text(&end)))
    }
}

/// Returns the failure of parts that round to no motion.
fn too_small(base: &DriveBase) -> Failure {
    let mm = 0.5 / most_counts(base, 1.0);
    let degrees = (2.0 * mm / base.track_mm).to_degrees();
    Failure::input(format!(
        "the parts move no wheel by a count of its encoder; the least is straight={mm:.2} or turn={degrees:.2} on this base"
    ))
}

/// Waits for the first reading of the gyro, if the base uses one.
fn await_gyro(session: &mut Session) -> Result<(), Failure> {
    if !repeat(POLL, Some(GYRO_START), |_| Ok(session.odometry()?.gyro != GyroState::Waiting))? {
        print_error_line(
            "warning: the gyro gives no readings; the base holds its heading by its encoders. Check that a BNO055 at address \
             0x28 is connected to I2C bus 0: `client i2c scan`",
        );
    }
    Ok(())
}

pub(super) fn odometry(hub: &HubOptions, json: bool) -> Result<(), Failure> {
    let report = hub.open(None)?.odometry()?;
    print_as(json, &OdometryValues::of(&report), text(&report))
}

fn text(report: &OdometryReport) -> String {
    let OdometryValues { x_mm, y_mm, heading_degrees, .. } = OdometryValues::of(report);
    let losses =
        if report.losses == 0 { String::new() } else { format!(", gyro lost {} times", report.losses) };
    format!(
        "x {x_mm:.1} mm, y {y_mm:.1} mm, heading {heading_degrees:.2} degrees {}{losses}",
        heading_text(report.gyro)
    )
}
