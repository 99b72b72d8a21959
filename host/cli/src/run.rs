//! Implements the command `motor-hub run`.

use crate::output::{Failure, Folder, drawn, progress};
use crate::parse::{number, whole};
use crate::scenario_options::ScenarioOptions;
use crate::scheme_options::SchemeOptions;
use simulated::scenario::{LONGEST_S, Scenario};
use simulated::sim::{self, RunError};
use std::path::PathBuf;
use studies::report::RunReport;

/// Run a scenario with and without a braking regime: tables, charts, CSV
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    source: ScenarioOptions,
    /// Length of the run in seconds
    #[arg(long = "time-s", alias = "time", value_name = "S")]
    #[arg(value_parser = number("a duration", 0.001..=LONGEST_S, "s"))]
    time: Option<f64>,
    /// How all motors are controlled
    #[command(flatten)]
    scheme: SchemeOptions,
    /// Seed of the measurement noise
    #[arg(long, value_parser = whole("a seed", 0..=u32::MAX, ""))]
    seed: Option<u32>,
    /// Folder for charts and CSV
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/run")]
    out: PathBuf,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let scenario = self.scenario()?;
        let folder = Folder::new(&self.out)?;
        let comparison = simulate(scenario).map_err(Failure::work)?;
        let mut files = drawn(&comparison.figures());
        files.extend(comparison.traces().map(|(name, text)| (name.to_owned(), text.into_bytes())));
        let json = self.json.then_some(|files: &[String]| comparison.json(files));
        folder.publish(files, "\nCharts (SVG) and traces (CSV) are", &comparison.tables(), json)?;
        let verdicts = comparison.verdicts();
        match verdicts.iter().filter(|verdict| !verdict.met()).count() {
            0 => Ok(()),
            unmet => Err(Failure::Work(format!("{unmet} of {} expectations are not met", verdicts.len()))),
        }
    }

    /// Returns the scenario with all options applied.
    fn scenario(&self) -> Result<Scenario, Failure> {
        let mut scenario = self.source.scenario(|default| default)?;
        if let Some(scheme) = self.scheme.scheme()? {
            scenario.motors.iter_mut().for_each(|motor| motor.scheme = scheme);
        }
        if let Some(duty) = self.scheme.duty {
            scenario.motors.iter_mut().for_each(|motor| motor.duty = duty);
        }
        scenario.duration_s = self.time.unwrap_or(scenario.duration_s);
        scenario.seed = self.seed.map_or(scenario.seed, u64::from);
        Ok(scenario)
    }
}

/// Runs the scenario with and then without a braking regime. A progress bar is shown if standard error is a terminal.
fn simulate(scenario: Scenario) -> Result<RunReport, RunError> {
    let bar = progress(Some((2000.0 * scenario.duration_s) as u64), "virtual ms");
    let at = |s: f64| bar.set_position((1000.0 * s) as u64);
    let as_set = sim::run(&scenario, &mut |s| at(s))?;
    let without = sim::run(&scenario.without_braking(), &mut |s| at(scenario.duration_s + s))?;
    bar.finish_and_clear();
    Ok(RunReport::new(scenario, as_set, without))
}
