//! `motor-hub serve`.

use super::{Failure, print};
use crate::scenario::Scenario;
use crate::serve::{self, Line, Scene};
use indicatif::ProgressBar;
use motor_hub::link::Address;
use std::path::PathBuf;

/// Text of the long help.
pub(super) const HELP: &str = "\
The simulated hub in real time behind the REV Hub Serial Protocol, for host software to talk to

The first line on standard output is what hosts open: the path of a serial port, or an address and port.
The motors, their loads and the battery are those of a scenario; its set-points are left to the host.
It runs until it is stopped (Ctrl-C).";

/// A hub is up after so many seconds, whatever its battery does.
const AWAKE_S: f64 = 0.5;

/// Where, and which hub.
#[derive(clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    line: LineOptions,
    /// Scenario file (TOML) instead of the default scenario
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Address of the hub, 1 to 254
    #[arg(long, value_name = "N", default_value = "2", value_parser = address)]
    address: Address,
    /// Ends after so many seconds
    #[arg(long = "for", value_name = "S", allow_negative_numbers = true, value_parser = seconds)]
    seconds: Option<f64>,
}

#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct LineOptions {
    /// On a pseudo-terminal, which hosts open as a serial port
    #[arg(long)]
    pty: bool,
    /// On a TCP port; port 0 is any that is free
    #[arg(long, value_name = "HOST:PORT")]
    tcp: Option<String>,
}

impl Options {
    pub(super) fn execute(self) -> Result<(), Failure> {
        let scenario = match &self.scenario {
            Some(path) => Scenario::load(path),
            None => Scenario::default_one(),
        };
        let scenario = scenario.map_err(Failure::Input)?;
        let line = match &self.line.tcp {
            Some(address) => Line::tcp(address).map_err(Failure::Input)?,
            None => Line::pty().map_err(Failure::Work)?,
        };
        let mut place = Some(format!("{line}\n"));
        let mut said_so = Ok(());
        let limit_s = self.seconds.unwrap_or(f64::INFINITY);
        let bar = ProgressBar::new_spinner();
        let lost = serve::run(&scenario, self.address, line, |scene| {
            if scene.snapshot.tick.is_multiple_of(5) {
                bar.set_message(said(&scene));
            }
            // Not before a motor can be enabled, unless the battery is at fault.
            if scene.snapshot.battery.is_some() || scene.at_s > AWAKE_S {
                said_so = place.take().map_or(Ok(()), |place| print(&place));
            }
            said_so.is_ok() && scene.at_s < limit_s
        });
        bar.finish_and_clear();
        let lost = lost.map_err(Failure::Work)?;
        said_so?;
        if !lost.is_zero() {
            eprintln!("this machine was too slow for real time: {:.1} s were lost", lost.as_secs_f64());
        }
        Ok(())
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

/// One line for people.
fn said(scene: &Scene) -> String {
    let battery = scene.snapshot.battery.map_or(0.0, |mv| f64::from(mv.0) * 1e-3);
    let motors = scene.snapshot.motors.iter().map(|motor| {
        let (mode, duty) = (motor.drive.mode.name(), 100.0 * motor.drive.duty.to_f64());
        format!(" | {} counts/s {mode} {duty:.0} %", motor.velocity.round())
    });
    let [red, green, blue] = [scene.led.red, scene.led.green, scene.led.blue];
    format!(
        "{:.0} s, LED #{red:02x}{green:02x}{blue:02x}, {battery:.2} V{}",
        scene.at_s,
        motors.collect::<String>()
    )
}
