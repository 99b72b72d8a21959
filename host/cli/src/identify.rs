//! `motor-hub identify`.

use crate::output::{Failure, Folder, drawn, print, print_json};
use crate::parse::whole;
use crate::source::Source;
use motor_hub::regulator::identify::Identification;
use simulated::scenario::Scenario;
use simulated::sim;
use std::path::PathBuf;
use studies::identify::{self, Identifications};

/// Text of the long help.
pub(crate) const HELP: &str = "\
What the hub learns of the motors on a simulated board from a motion of a few seconds, beside what they are

All motors of the scenario are identified at once, on one battery; its set-points are left out. What the hub \
is told of winding and back EMF, and how wrong that is, the scenario says. Nothing pulls on the default scenario's \
motors; the torques of a scenario that is named act from the start, and a motor that they pull on is refused. \
For a hub on a line there is `motor-hub client identify`.

Exit codes: 0 all motors are known; 1 one is not; 2 wrong options.";

/// Which motors, and where the chart goes.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    source: Source,
    /// Counts that each may turn at most, either way; fewer make the motion shorter
    #[arg(long = "travel-counts", alias = "travel", value_name = "COUNTS", default_value_t = u32::MAX)]
    #[arg(hide_default_value = true, value_parser = whole("a travel", 0..=u32::MAX, "counts"))]
    travel: u32,
    /// Folder for the chart
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/identify")]
    out: PathBuf,
    /// JSON instead of tables
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
        if self.json {
            print_json(&learned.json())?;
        } else {
            print(&learned.tables())?;
        }
        folder.write_all(drawn(&[("identify".to_owned(), learned.figure())]))?;
        if !self.json {
            print(&format!("The chart (SVG) is in {folder}\n"))?;
        }
        let known = |outcome: &Identification| matches!(outcome, Identification::Found(_));
        match learned.outcomes().filter(|outcome| !known(outcome)).count() {
            0 => Ok(()),
            unknown => Err(Failure::Work(format!("{unknown} of the motors cannot be known in this way"))),
        }
    }
}
