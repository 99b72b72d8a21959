//! `motor-hub serve`, and what it has in common with serving the emulated chip.

use super::{Failure, print};
use crate::scenario::Scenario;
use crate::serve::{self, Line, Moment};
use indicatif::ProgressBar;
use motor_hub::protocol::Address;
use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

/// Text of the long help.
pub(super) const HELP: &str = "\
A simulated hub in real time behind the REV Hub Serial Protocol, for host software to talk to

The first line on standard output is what hosts open: the path of a serial port, or an address and port.
The motors, their loads and the battery are those of a scenario; its set-points are left to the host. Nothing
pulls on the default scenario's motors; the torques of a scenario that is named act from the start.
It runs until it is stopped (Ctrl-C).";

/// A hub is up after so many seconds, whatever its battery does.
const AWAKE_S: f64 = 0.5;

/// Where, and which hub.
#[derive(clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    serving: Serving,
    /// Address of the hub, 1 to 254
    #[arg(long, value_name = "N", default_value = "2", value_parser = address)]
    address: Address,
    /// The flashed image on an emulated chip instead of the simulated board: the program `emulate`, which
    /// `cargo build --release --package emulated` puts beside this one, and which builds the image if it is not
    /// fresh. Its address is 2
    #[arg(long, conflicts_with = "address")]
    emulated: bool,
}

impl Options {
    pub(super) fn execute(self) -> Result<(), Failure> {
        if self.emulated {
            return self.serving.pass_on_to("emulate");
        }
        self.serving.execute(Scenario::default_one, |scenario, line, show| {
            serve::run(scenario, self.address, line, show)
        })
    }
}

/// How a hub is served, whatever runs it.
#[derive(clap::Args)]
pub struct Serving {
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
    ///
    /// # Errors
    /// If the scenario or the place is no good, or as `run` does.
    pub fn execute(
        self,
        default: impl FnOnce() -> Result<Scenario, String>,
        run: impl FnOnce(&Scenario, Line, &mut dyn FnMut(Moment<'_>) -> bool) -> Result<Duration, String>,
    ) -> Result<(), Failure> {
        let scenario = match &self.scenario {
            Some(file) => Scenario::load(file),
            // Its torques belong to its set-points.
            None => default().map(Scenario::undisturbed),
        };
        let scenario = scenario.map_err(Failure::Input)?;
        let line = match &self.place.tcp {
            Some(address) => Line::tcp(address).map_err(Failure::Input)?,
            None => Line::pty().map_err(Failure::Work)?,
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
        let lost = lost.map_err(Failure::Work)?;
        said_so?;
        if !lost.is_zero() {
            eprintln!("this machine was too slow for real time: {:.1} s were lost", lost.as_secs_f64());
        }
        Ok(())
    }

    /// The same by another program of this workspace.
    fn pass_on_to(&self, program: &str) -> Result<(), Failure> {
        let path = std::env::current_exe()
            .map_err(|e| Failure::Work(format!("where this program is: {e}")))?
            .with_file_name(format!("{program}{}", std::env::consts::EXE_SUFFIX));
        let mut command = Command::new(&path);
        command.arg("serve");
        match &self.place.tcp {
            Some(address) => command.args(["--tcp", address]),
            None => command.arg("--pty"),
        };
        if let Some(file) = &self.scenario {
            command.arg("--scenario").arg(file);
        }
        if let Some(limit_s) = self.limit_s {
            command.arg("--for").arg(limit_s.to_string());
        }
        let failed = |error| {
            let build = "`cargo build --release --package emulated` builds it";
            Failure::Work(format!("{}: {error}; {build}", path.display()))
        };
        // In the place of this process, so that whoever stops one stops both.
        #[cfg(unix)]
        let done = Err(failed(std::os::unix::process::CommandExt::exec(&mut command)));
        #[cfg(not(unix))]
        let done = match command.status().map_err(failed)?.code() {
            Some(0) => Ok(()),
            code => Err(Failure::Work(format!("{program} ended with {code:?}"))),
        };
        done
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    let length = text.parse().ok().filter(|length: &f64| length.is_finite() && *length > 0.0);
    length.ok_or_else(|| "a length is more than 0 seconds".into())
}

fn address(text: &str) -> Result<Address, String> {
    text.parse()
        .ok()
        .and_then(Address::new)
        .ok_or_else(|| "an address is a whole number from 1 to 254".into())
}
