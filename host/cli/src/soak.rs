//! `motor-hub soak`.

use crate::output::{Failure, print, print_json, progress};
use crate::parse::whole;
use studies::survey::soak::{self, Soak};

/// The long help of the command.
pub(crate) const HELP: &str = "\
Hours of scenarios by lot in virtual time, run by the hub's own tasks: false alarms and starved watchdogs are counted

Scenarios are those of the survey: any motor, load, battery, period and scheme; told everything, wrong inertias or \
nothing; half of them on bridges with the timing of real ones. All of it is sound, so every fault that the hub reports \
is a false alarm. `survey --seed SEED --dump NUMBER` writes one as a file, which has ideal bridges and is told everything.

Exit codes: 0 nothing of the kind; 1 something; 2 wrong options.";

/// Options of `soak`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// What the scenarios follow from
    #[arg(long, default_value_t = 1, value_parser = whole("a seed", 0..=u64::MAX, ""))]
    seed: u64,
    /// Instead of a lot every motor, inertia, scheme, duty rule, friction, voltage and period, told and not: 12 hours
    #[arg(long, conflicts_with_all = ["seed", "hours"])]
    sweep: bool,
    /// Hours of virtual time, 0 to 1000
    #[arg(long, default_value_t = 1.0, value_parser = hours)]
    hours: f64,
    /// One JSON document on standard output instead of text
    #[arg(long)]
    json: bool,
}

fn hours(text: &str) -> Result<f64, String> {
    let hours = text.parse().ok().filter(|hours| (0.0..=1000.0).contains(hours));
    hours.ok_or_else(|| "how long is 0 to 1000 hours".to_owned())
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let soak = if self.sweep {
            let bar = progress(None, "scenarios");
            Soak::sweep(1, &mut |done, of| {
                bar.set_length(of as u64);
                bar.set_position(done as u64);
            })
        } else {
            let seconds = 3600.0 * self.hours;
            let bar = progress(Some(seconds as u64), "virtual seconds");
            Soak::new(self.seed, seconds, &mut |done| bar.set_position(done as u64))
        };
        let soak = soak.map_err(Failure::work)?;
        if self.json {
            print_json(&soak)?;
        } else {
            print(&soak::text(&soak))?;
        }
        if soak.is_clean() {
            Ok(())
        } else {
            Err(Failure::Work("something was reported that was not so".to_owned()))
        }
    }
}
