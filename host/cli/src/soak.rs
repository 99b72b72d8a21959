//! Implements the command `motor-hub soak`.

use crate::output::{Failure, in_steps, print, print_json, progress};
use crate::parse::{number, whole};
use studies::survey::soak::{self, Soak};
use studies::survey::sweep;

/// Run hours of random scenarios in virtual time by the hub's own tasks, and count false alarms and starved watchdogs
///
/// Scenarios are those of the survey: any motor, load, battery, period and scheme; configured exactly, with wrong
/// inertias, or not configured. Half of them have bridges with the timing of real ones. All hardware is sound, so
/// every fault that the hub reports is a false alarm. `survey --seed SEED --dump NUMBER` writes a scenario as a file,
/// with ideal bridges and configured exactly.
///
/// Exit codes: 0 no false alarm; 1 a false alarm or a starved watchdog; 2 wrong options.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Seed of the random scenarios
    #[arg(long, default_value_t = 1, value_parser = whole("a seed", 0..=u64::MAX, ""))]
    seed: u64,
    /// Instead of random scenarios: every motor, inertia, scheme, duty rule, friction, voltage and period, configured and
    /// not; 12 hours of virtual time
    #[arg(long, conflicts_with_all = ["seed", "hours"])]
    sweep: bool,
    /// With --sweep: every motor with 1 to 1000 times its rotor's inertia, two minutes each; 126 hours of virtual time
    #[arg(long, requires = "sweep")]
    long: bool,
    /// Hours of virtual time, 0.001 to 1000
    #[arg(long, default_value_t = 1.0, value_parser = number("a time", 0.001..=1000.0, "hours"))]
    hours: f64,
    /// Print one JSON document instead of text
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let soak = if self.sweep {
            let cases = if self.long { sweep::long_scenarios(1) } else { sweep::scenarios(1) };
            in_steps("scenarios", |step| Soak::sweep(&cases, step))
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
        if soak.is_clean() { Ok(()) } else { Err(Failure::Work(soak::headline(&soak))) }
    }
}
