//! `motor-hub run`.

use crate::choice::Choice;
use crate::output::{Failure, drawn, print, print_json, write_all};
use crate::parse::run_seconds;
use indicatif::ProgressBar;
use motor_hub::model::catalogue::characterised;
use motor_hub::units::Period;
use simulated::hardware::MOTORS;
use simulated::scenario::Scenario;
use simulated::sim::{self, RunError};
use std::path::PathBuf;
use studies::report::RunReport;

/// What is run, and where its output goes.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Scenario file (TOML) instead of the default scenario
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Length of the run in seconds
    #[arg(long, value_name = "S", value_parser = run_seconds)]
    time: Option<f64>,
    /// Motor of the catalogue in the place of the default scenario's first, second, ... motor, with
    /// speeds and loads in proportion; up to four. The run has as many motors as are named
    #[arg(long, value_name = "NAME", conflicts_with = "scenario")]
    motor: Vec<String>,
    /// Of all motors
    #[command(flatten)]
    choice: Choice,
    /// Control period in milliseconds
    #[arg(long, value_name = "MS", value_parser = clap::value_parser!(u32).range(1..=100))]
    period: Option<u32>,
    /// What the noise of the measurements follows from
    #[arg(long)]
    seed: Option<u32>,
    /// Folder for charts and CSV
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/run")]
    out: PathBuf,
    /// One JSON document on standard output instead of tables
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let comparison = simulate(self.scenario()?).map_err(Failure::work)?;
        let mut files: Vec<_> =
            comparison.traces().map(|(name, text)| (name.to_owned(), text.into_bytes())).into();
        files.extend(drawn(&comparison.figures())?);
        let files = write_all(&self.out, files)?;
        if self.json {
            print_json(&comparison.json(&files))?;
        } else {
            print(&comparison.tables())?;
            print(&format!("\nCharts (SVG, PNG) and traces (CSV) are in {}\n", self.out.display()))?;
        }
        let verdicts = comparison.verdicts();
        match verdicts.iter().filter(|verdict| !verdict.met()).count() {
            0 => Ok(()),
            unmet => Err(Failure::Work(format!("{unmet} of {} expectations are not met", verdicts.len()))),
        }
    }

    /// The scenario with all options applied.
    fn scenario(&self) -> Result<Scenario, Failure> {
        let mut scenario = match &self.scenario {
            Some(path) => Scenario::load(path),
            None => Scenario::default_one(),
        }
        .map_err(Failure::input)?;
        if self.motor.len() > MOTORS {
            let times = self.motor.len();
            return Err(Failure::Input(format!(
                "--motor is given {times} times; the hub drives 1 to {MOTORS}"
            )));
        }
        if !self.motor.is_empty() {
            scenario.motors.truncate(self.motor.len());
        }
        for (motor, name) in scenario.motors.iter_mut().zip(&self.motor) {
            let constants = characterised(name).map_err(Failure::input)?;
            *motor = motor.with_constants(constants.with_measured_rotor_inertia());
        }
        if let Some(scheme) = self.choice.scheme().map_err(Failure::input)? {
            scenario.motors.iter_mut().for_each(|motor| motor.scheme = scheme);
        }
        if let Some(duty) = self.choice.duty() {
            scenario.motors.iter_mut().for_each(|motor| motor.duty = duty);
        }
        if let Some(ms) = self.period {
            scenario.period = Period::from_millis(ms).map_err(Failure::input)?;
        }
        scenario.duration_s = self.time.unwrap_or(scenario.duration_s);
        scenario.seed = self.seed.map_or(scenario.seed, u64::from);
        Ok(scenario)
    }
}

/// Runs the scenario twice, with a progress bar if standard error is a terminal.
fn simulate(scenario: Scenario) -> Result<RunReport, RunError> {
    let bar = ProgressBar::new((2000.0 * scenario.duration_s) as u64).with_message("virtual ms");
    let at = |s: f64| bar.set_position((1000.0 * s) as u64);
    let as_set = sim::run(&scenario, &mut |s| at(s))?;
    let without = sim::run(&scenario.without_braking(), &mut |s| at(scenario.duration_s + s))?;
    bar.finish_and_clear();
    Ok(RunReport::new(scenario, as_set, without))
}
