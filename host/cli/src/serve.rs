//! `motor-hub serve`: the simulated board, or the flashed image on the emulated chip.

use crate::output::{Failure, print};
use crate::parse::{address, seconds};
use emulated::elf;
use indicatif::ProgressBar;
use motor_hub::protocol::Address;
use simulated::scenario::{Scenario, ScenarioError};
use simulated::serve::{self, Line, LineError, Moment};
use std::path::PathBuf;
use std::time::Duration;

/// Text of the long help.
pub(crate) const HELP: &str = "\
A simulated hub in real time behind the REV Hub Serial Protocol, for host software to talk to

The first line on standard output is what hosts open: the path of a serial port, or an address and port.
The motors, their loads and the battery are those of a scenario; its set-points are left to the host. Nothing
pulls on the default scenario's motors; the torques of a scenario that is named act from the start.
It runs until it is stopped (Ctrl-C).";

/// A hub is up after so many seconds, whatever its battery does.
const AWAKE_S: f64 = 0.5;

/// Where, and which hub.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    serving: Serving,
    /// Address of the hub, 1 to 254
    #[arg(long, value_name = "N", default_value = "2", value_parser = address)]
    address: Address,
    /// The flashed image on an emulated chip instead of the simulated board. It is built first if it is not
    /// fresh. Its address is 2
    #[arg(long, conflicts_with = "address")]
    emulated: bool,
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        if self.emulated {
            elf::check_named().map_err(Failure::input)?;
            return self.serving.execute(emulated::serve::scenario, emulated::serve::run);
        }
        self.serving.execute(Scenario::default_one, |scenario, line, show| {
            serve::run(scenario, self.address, line, show)
        })
    }
}

/// How a hub is served, whatever runs it.
#[derive(clap::Args)]
struct Serving {
    #[command(flatten)]
    place: Place,
    /// Scenario file (TOML) instead of the default scenario
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Ends after so many seconds
    #[arg(long = "for", value_name = "S", allow_negative_numbers = true, value_parser = seconds)]
    limit_s: Option<f64>,
}

#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct Place {
    /// On a pseudo-terminal, which hosts open as a serial port
    #[arg(long)]
    pty: bool,
    /// On a TCP port; port 0 is any that is free
    #[arg(long, value_name = "HOST:PORT")]
    tcp: Option<String>,
}

impl Serving {
    /// Says where the hub is as soon as it is awake, and serves it. `run` gives back the time that was
    /// lost because this machine was too slow.
    fn execute<E: std::error::Error>(
        self,
        default: impl FnOnce() -> Result<Scenario, ScenarioError>,
        run: impl FnOnce(&Scenario, Line, &mut dyn FnMut(Moment<'_>) -> bool) -> Result<Duration, E>,
    ) -> Result<(), Failure> {
        let scenario = match &self.scenario {
            Some(file) => Scenario::load(file),
            // Its torques belong to its set-points.
            None => default().map(Scenario::undisturbed),
        };
        let scenario = scenario.map_err(Failure::input)?;
        let line = match &self.place.tcp {
            Some(address) => Line::tcp(address).map_err(Failure::input)?,
            None => Line::pty().map_err(no_pty)?,
        };
        let mut place = Some(format!("{line}\n"));
        let mut said_so = Ok(());
        let bar = ProgressBar::new_spinner();
        let mut shown_s = 0.0;
        let lost = run(&scenario, line, &mut |Moment { at_s, awake, describe }| {
            // Not before a motor can be enabled, unless the battery is at fault.
            if awake || at_s > AWAKE_S {
                said_so = place.take().map_or(Ok(()), |place| print(&place));
            }
            if at_s > shown_s && !bar.is_hidden() {
                shown_s = at_s + 0.2;
                bar.set_message(format!("{at_s:.0} s, {}", describe()));
            }
            said_so.is_ok() && self.limit_s.is_none_or(|limit_s| at_s < limit_s)
        });
        bar.finish_and_clear();
        let lost = lost.map_err(Failure::work)?;
        said_so?;
        if !lost.is_zero() {
            eprintln!("this machine was too slow for real time: {:.1} s were lost", lost.as_secs_f64());
        }
        Ok(())
    }
}

fn no_pty(error: LineError) -> Failure {
    match error {
        LineError::NoPtys => Failure::Work(format!("{error}; serve with --tcp instead")),
        error => Failure::work(error),
    }
}
