//! Implements the command `motor-hub survey`.

use crate::output::{Failure, Folder, drawn, in_steps, print_paths};
use crate::parse::whole;
use serde_json::json;
use std::path::PathBuf;
use studies::survey::{Results, Survey, bare_motors, random, reference};
use studies::{StudyError, with_fields};

/// A part of the survey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Part {
    /// The reference tasks
    Reference,
    /// Motors without a load
    Cells,
    /// Random scenarios
    Random,
}

/// Measure how well motors are regulated: reference tasks, bare motors, random scenarios
///
/// Every part runs with motors that are configured exactly, and with unknown motors. Of an unknown motor only the
/// winding is configured, and the hub learns its acceleration per volt.
///
/// reference: tasks with known results, at six control periods.
///
/// cells: every motor of the catalogue without a load, at a speed and to a position, at four control periods.
///
/// random: scenarios with random motors, loads, batteries, periods and schemes. Each scenario runs with the exact
/// constants and with wrong constants: an inertia of 0.7 and 1.4 times, R of 0.8 and 1.2 times and Ke of 0.9 and 1.1
/// times the true value, the constants of the cold motor while the motor is hot, and the constants of another
/// specimen. Half of the motors have dry friction of up to 10 % of the stall torque.
///
/// A random response counts only if a regulator can settle it. The ideal time is the time of the motion at the usable
/// voltage, which is 95 % of the battery voltage with all motors stalled. The granted time is 1.5 times the ideal time
/// plus 0.3 s, six control periods and the time of three counts. After the granted time at least a tenth of the
/// response, and at least one second, must be left. A tenth of the usable voltage must be left at the set-point.
///
/// Seed and number identify a scenario; --dump writes it as a file for `motor-hub run`. The folder gets the charts,
/// and the tables as Markdown in tables.md.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Run only this part
    #[arg(long, value_name = "PART")]
    only: Option<Part>,
    /// Seed of the random scenarios; 1 by default
    #[arg(long, value_parser = whole("a seed", 0..=u64::MAX, ""))]
    seed: Option<u64>,
    /// Number of random scenarios; 300 by default
    #[arg(long, value_parser = whole("how many", 1..=1_000_000_u64, "scenarios"))]
    scenarios: Option<u64>,
    /// Number of worst responses to list
    #[arg(long, default_value_t = 10, value_parser = whole("how many to list", 0..=1_000_000_usize, "responses"))]
    worst: usize,
    /// Write the random scenario of this number to the folder, and run nothing
    #[arg(long, value_name = "NUMBER", value_parser = whole("a scenario's number", 0..=u64::MAX, ""))]
    #[arg(conflicts_with_all = ["only", "scenarios", "worst", "json"])]
    dump: Option<u64>,
    /// Folder for charts and tables.md, or for the scenario of --dump
    #[arg(long, value_name = "DIR", default_value = "target/motor-hub/survey")]
    out: PathBuf,
    /// Print one JSON document instead of tables
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let wanted = |part| self.only.is_none_or(|only| only == part);
        if !wanted(Part::Random) && (self.seed.is_some() || self.scenarios.is_some()) {
            return Err(Failure::input(
                "--seed and --scenarios are of the random scenarios, which --only leaves out",
            ));
        }
        let seed = self.seed.unwrap_or(1);
        let folder = Folder::new(&self.out)?;
        if let Some(number) = self.dump {
            let name = format!("survey-{seed}-{number}.toml");
            let text = random::toml(&random::scenario(seed, number));
            return print_paths(&folder.write_all(vec![(name, text.into_bytes())])?);
        }
        let results = in_steps("steps", |step| {
            Ok(Results {
                reference: wanted(Part::Reference).then(|| reference::run(step)).transpose()?,
                cells: wanted(Part::Cells).then(|| bare_motors::run(step)).transpose()?,
                survey: wanted(Part::Random)
                    .then(|| Survey::new(seed, self.scenarios.unwrap_or(300), step))
                    .transpose()?,
            })
        })
        .map_err(|error: StudyError| Failure::work(error))?;
        let page = results.page(self.worst);
        let mut files = drawn(&results.figures());
        files.push(("tables.md".to_owned(), page.markdown().into_bytes()));
        let document = |files: &[String]| with_fields(json!(results), json!({ "files": files }));
        let json = self.json.then_some(document);
        folder.publish(files, "Charts (SVG) and tables (Markdown) are", &page.terminal(), json)
    }
}
