//! Implements the command `motor-hub identify`.

use crate::output::{Failure, Folder, drawn};
use crate::parse::whole;
use crate::scenario_options::ScenarioOptions;
use motor_hub::regulator::identify::Identification;
use simulated::scenario::Scenario;
use simulated::sim;
use std::path::PathBuf;
use studies::identify::{self, Identifications};

/// Identify simulated motors by a short motion, and compare with their true values
///
/// All motors of the scenario are identified at once, on one battery, without the scenario's set-points. The scenario
/// says how winding and back EMF are configured. The default scenario has no torque on its motors. The torques of a
/// scenario file act from the start; a motor that a torque turns is refused. `motor-hub client identify` identifies a
/// motor on a real hub.
///
/// Exit codes: 0 all motors are identified; 1 a motor is not; 2 wrong options.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    source: ScenarioOptions,
    /// Largest travel of each motor in counts, in both directions; less travel makes the motion shorter
    #[arg(long = "travel-counts", alias = "travel", value_name = "COUNTS", default_value_t = u32::MAX)]
    #[arg(hide_default_value = true, value_parser = whole("a travel", 0..=u32::MAX, "counts"))]
    travel: u32,
    /// Folder for the chart
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/identify")]
    out: PathBuf,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let mut scenario = identify::scenario(self.source.scenario(Scenario::undisturbed)?, self.travel);
        let folder = Folder::new(&self.out)?;
        let mut trace = sim::run(&scenario, &mut |_| ()).map_err(Failure::work)?;
        if let Some(longer) = identify::longer(&scenario, &trace) {
            trace = sim::run(&longer, &mut |_| ()).map_err(Failure::work)?;
            scenario = longer;
        }
        let learned = Identifications::new(scenario, trace).map_err(Failure::input)?;
        let files = drawn(&[("identify".to_owned(), learned.figure())]);
        let json = self.json.then_some(|_: &[String]| learned.json());
        folder.publish(files, "The chart (SVG) is", &learned.tables(), json)?;
        let known = |outcome: &Identification| matches!(outcome, Identification::Found(_));
        match learned.outcomes().filter(|outcome| !known(outcome)).count() {
            0 => Ok(()),
            unknown => Err(Failure::Work(format!("{unknown} of the motors could not be identified"))),
        }
    }
}
