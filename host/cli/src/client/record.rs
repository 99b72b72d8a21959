//! `motor-hub client record`: drives motors and records the hub's values.

use super::drive::Drive;
use super::hub::HubOptions;
use super::motion::{Motion, Progress};
use super::motors_off::DrivingSession;
use super::readings::{MotorReading, motors_of, put_motion, repeat};
use crate::output::{Failure, Folder, drawn, print, write_file};
use crate::parse::{whole, with_negative_numbers};
use clap::{CommandFactory, FromArgMatches};
use motor_hub::extension::report::ReportedSetpoint;
use motor_hub::protocol::answers::Bulk;
use motor_hub::units::Milliamperes;
use motor_hub_client::error::none_if_unsupported;
use motor_hub_client::motor::Setpoint;
use motor_hub_client::{Error, Session};
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use studies::recording::{HEADINGS, Recording, Sample};

/// Drives motors as `power`, `current`, `velocity` or `position` do, and records the values: CSV, and a chart of each
/// motor
///
/// motor-hub client --port /dev/ttyACM0 record -- velocity 0 1000 --for-s 3
///
/// The file has a row for each motor and reading. A value that the hub does not report is left empty: other makers'
/// hubs may report no control value and no current. However the drive ends, also by Ctrl-C, the file has only
/// complete rows, and the charts are drawn.
#[derive(clap::Args)]
pub(super) struct Options {
    /// Readings per second
    #[arg(long = "rate-hz", alias = "rate", value_name = "HZ", default_value_t = 50)]
    #[arg(value_parser = whole("a rate", 1..=500_u32, "Hz"))]
    rate: u32,
    /// Folder for record.csv and the charts
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/record")]
    out: PathBuf,
    /// power, current, velocity or position, with its options
    #[arg(value_name = "DRIVE", required = true, trailing_var_arg = true, allow_hyphen_values = true)]
    drive: Vec<String>,
}

/// The command that is recorded.
#[derive(clap::Parser)]
#[command(name = "record --", no_binary_name = true, disable_help_subcommand = true, max_term_width = 80)]
#[command(subcommand_value_name = "power|current|velocity|position")]
struct Recorded {
    #[command(subcommand)]
    drive: Drive,
}

impl Options {
    fn parsed(&self) -> Result<Drive, Failure> {
        let mut command = with_negative_numbers(Recorded::command());
        let parsed = command.try_get_matches_from_mut(&self.drive);
        let parsed = parsed.and_then(|mut matches| Recorded::from_arg_matches_mut(&mut matches));
        let parsed = parsed.map_err(|error| {
            if !error.use_stderr() {
                // The user asked for help.
                error.exit();
            }
            let text = error.to_string();
            Failure::input(text.strip_prefix("error: ").unwrap_or(&text).trim_end())
        })?;
        Ok(parsed.drive)
    }

    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let drive = self.parsed()?;
        let motion = drive.motion()?;
        let folder = Folder::new(&self.out)?;
        let session = &mut hub.open(drive.hub())?;
        let interval = Duration::from_secs(1) / self.rate;
        // Between two recorded readings the motors are read as often as the judgement of a speed needs.
        let readings_per_row = JUDGED_HZ.div_ceil(self.rate);
        let mut progress = Progress::new(&motion, interval / readings_per_row);
        let words = format!("motor-hub client record -- {}", self.drive.join(" "));
        let mut recorder = Recorder::new(&self.out, &words, &motion)?;
        let done = DrivingSession::run(session, |driven| {
            motion.begin(driven)?;
            let mut checked = Instant::now();
            let mut readings = 0_u32;
            let settled = repeat(interval / readings_per_row, motion.length, |since| {
                if checked.elapsed() > CHECK {
                    motion.check(driven)?;
                    checked = Instant::now();
                }
                let recorded = readings.is_multiple_of(readings_per_row);
                readings = readings.wrapping_add(1);
                recorder.read(driven, &motion, since, recorded, &mut progress)
            })?;
            if settled { Ok(()) } else { progress.judge() }
        });
        let finished = recorder.finish(&folder);
        done.and(finished)
    }
}

struct Recorder {
    path: PathBuf,
    file: File,
    recording: Recording,
    /// False once the hub has refused to report a current.
    reports_current: bool,
    readings: u32,
    length: Duration,
    slowest: Duration,
}

impl Recorder {
    fn new(folder: &Path, words: &str, motion: &Motion) -> Result<Self, Failure> {
        let path = folder.join("record.csv");
        write_file(&path, HEADINGS.as_bytes())?;
        let file = OpenOptions::new().append(true).open(&path);
        let file = file.map_err(|e| Failure::Work(format!("{}: {e}", path.display())))?;
        let requested = match motion.setpoint {
            Setpoint::Power(power) => ReportedSetpoint::Power(power),
            Setpoint::Current { ma, .. } => ReportedSetpoint::Current(Milliamperes::new(ma)),
            Setpoint::Velocity(cps) => ReportedSetpoint::Velocity(cps.into()),
            Setpoint::Position { counts, .. } => ReportedSetpoint::Position(counts),
        };
        Ok(Self {
            path,
            file,
            recording: Recording::new(words, requested),
            reports_current: true,
            readings: 0,
            length: Duration::ZERO,
            slowest: Duration::ZERO,
        })
    }

    /// Takes a reading, and writes the reading to the file if it is `recorded`. Returns true if the motors have settled.
    fn read(
        &mut self,
        session: &mut Session,
        motion: &Motion,
        since: Instant,
        recorded: bool,
        progress: &mut Progress<'_>,
    ) -> Result<bool, Failure> {
        let begun = Instant::now();
        let report = session.report()?;
        let (battery, bulk) = match &report {
            Some(report) => {
                let mut bulk = Bulk::default();
                put_motion(report, &mut bulk);
                (report.battery.unwrap_or_default(), bulk)
            }
            None => (session.battery()?, session.bulk()?),
        };
        let at = since.elapsed();
        let settled = progress.observe(at, &bulk, report.as_ref());
        if !recorded {
            return settled;
        }
        let battery_v = f64::from(battery.get()) / 1e3;
        let mut rows = String::new();
        for MotorReading { motor, position, velocity: cps, .. } in motors_of(&bulk, &motion.motors) {
            let of = report.as_ref().and_then(|report| report.motors.get(usize::from(motor)));
            let settled = of.map(|of| of.settled);
            let (control, current_a) = match of {
                Some(of) => (Some(of.control.get()), Some(f64::from(of.best_current().get().abs()) / 1e3)),
                None => (None, self.current(session, motor)?),
            };
            let at_s = at.as_secs_f64();
            let sample = Sample { at_s, motor, battery_v, position, cps, control, current_a, settled };
            rows += &self.recording.push(sample);
        }
        // Complete rows are written immediately, so that no row is lost if the program is killed.
        let written = self.file.write_all(rows.as_bytes());
        written.map_err(|e| Failure::Work(format!("{}: {e}", self.path.display())))?;
        (self.readings, self.length) = (self.readings + 1, at);
        self.slowest = self.slowest.max(begun.elapsed());
        settled
    }

    /// Current of a motor in amperes; `None` once the hub has refused to report it.
    fn current(&mut self, session: &mut Session, motor: u8) -> Result<Option<f64>, Error> {
        if !self.reports_current {
            return Ok(None);
        }
        let current = none_if_unsupported(session.current(motor))?;
        self.reports_current = current.is_some();
        Ok(current.map(|current| f64::from(current.get()) / 1e3))
    }

    /// Draws the charts, and prints a summary.
    fn finish(&self, folder: &Folder) -> Result<(), Failure> {
        let charts = folder.write_all(drawn(&self.recording.figures()))?;
        let rate = f64::from(self.readings.saturating_sub(1)) / self.length.as_secs_f64().max(1e-3);
        let slowest = self.slowest.as_secs_f64() * 1e3;
        let of = |count: usize, one: &str| format!("{count} {one}{}", if count == 1 { "" } else { "s" });
        print(&format!(
            "{}, {rate:.1} per second, slowest reading {slowest:.1} ms: {} and {}\n",
            of(self.readings as usize, "reading"),
            self.path.display(),
            of(charts.len(), "chart")
        ))
    }
}

/// Least number of readings per second by which the speed of a motor is judged. The mean of the last 0.5 s is then of at
/// least five readings.
const JUDGED_HZ: u32 = 10;

/// Interval between two checks whether the motors are still enabled.
const CHECK: Duration = Duration::from_millis(500);
