//! Options that name the hub of a command, and the session with this hub.

use super::motors_off::disable_left_enabled;
use super::ports;
use crate::output::Failure;
use crate::parse::{address, host_and_port, whole};
use clap::builder::NonEmptyStringValueParser;
use motor_hub::extension::HubFunction::{Load, Reset, Save, Stored};
use motor_hub::extension::Request;
use motor_hub::protocol::{Address, Nack};
use motor_hub_client::line::{Line, is_tcp};
use motor_hub_client::{Error, Session};
use std::time::Duration;

/// Line and address of the hub.
#[derive(clap::Args)]
pub(super) struct HubOptions {
    /// Serial port of the hub, or a pseudo-terminal (460800 baud, 8N1); or HOST:PORT, as with --tcp
    #[arg(long, value_name = "PATH", global = true, help_heading = "Hub", value_parser = NonEmptyStringValueParser::new())]
    port: Option<String>,
    /// TCP address of the hub, instead of --port
    #[arg(long, value_name = "HOST:PORT", global = true, help_heading = "Hub", value_parser = host_and_port)]
    tcp: Option<String>,
    /// Address of the hub, 1 to 254 [default: found by discovery]
    #[arg(long, value_name = "N", global = true, help_heading = "Hub", value_parser = address)]
    pub(super) address: Option<Address>,
    /// Time-out for an answer in milliseconds; within it a request is sent up to three times
    #[arg(long = "timeout-ms", alias = "timeout", value_name = "MS", global = true, help_heading = "Hub")]
    #[arg(default_value_t = 1000, value_parser = whole("a timeout", 10..=60_000_u64, "ms"))]
    timeout: u64,
}

impl HubOptions {
    pub(super) fn places(&self) -> impl Iterator<Item = String> {
        self.port.iter().chain(&self.tcp).cloned()
    }

    pub(super) fn timeout(&self) -> Duration {
        Duration::from_millis(self.timeout)
    }

    fn line(&self) -> Result<Line, Failure> {
        let (name, line) = match (&self.port, &self.tcp) {
            (Some(path), None) => (path, Line::open(path, self.timeout())),
            (None, Some(address)) => (address, Line::tcp(address, self.timeout())),
            (Some(_), Some(_)) => return Err(Failure::input("--port and --tcp exclude each other")),
            (None, None) => {
                let found = ports::list().unwrap_or_default();
                let text = format!("no hub given: give --port PATH or --tcp HOST:PORT\n{found}");
                return Err(Failure::input(text.trim_end()));
            }
        };
        line.map_err(|error| Failure::Work(ports::unopened(name, &error)))
    }

    /// Opens a session on the line for requests to all hubs.
    pub(super) fn session_of_line(&self) -> Result<Session, Failure> {
        Ok(Session::new(self.line()?, Address::DEFAULT, self.timeout()))
    }

    /// Opens a session with the hub of `--address`. Without the option the hub is `of_motors`, the hub that the motors
    /// of the command name. Without either the hub is the parent on the line.
    pub(super) fn session(&self, of_motors: Option<Address>) -> Result<Session, Failure> {
        let address = match (self.address, of_motors) {
            (Some(given), Some(named)) if given != named => {
                return Err(Failure::Input(format!(
                    "--address {} and a motor of the hub at address {} exclude each other",
                    given.get(),
                    named.get()
                )));
            }
            (given, named) => given.or(named),
        };
        let line = self.line()?;
        match address {
            Some(address) => Ok(Session::new(line, address, self.timeout())),
            None => Ok(Session::with_parent(line, self.timeout())?),
        }
    }

    /// Opens a session by [`Self::session`], and disables motors that another host has left enabled.
    pub(super) fn open(&self, of_motors: Option<Address>) -> Result<Session, Failure> {
        let mut session = self.session(of_motors)?;
        disable_left_enabled(&mut session)?;
        // A later report shows a reset of the hub.
        session.report()?;
        Ok(session)
    }

    /// Adds the place of the hub to an error of the hub. Other failures are returned unchanged.
    pub(super) fn explain(&self, failure: Failure) -> Failure {
        let Failure::Hub(error) = failure else { return failure };
        let name: String = self.places().collect();
        Failure::Work(match &error {
            Error::Refused { request, reason: Nack::UNSUPPORTED }
                if matches!(**request, Request::Hub(Save | Load | Reset | Stored)) =>
            {
                format!("{name}: {error}; a simulated hub stores settings if it is started with --store FILE")
            }
            Error::Parents { .. } => format!("{name}: {error}; choose a hub by --address"),
            _ if is_tcp(&name) && error.is_hung_up() => format!(
                "{name}: {error}; a served hub accepts one host at a time: check that no other host uses it, and that it still runs"
            ),
            _ if error.is_hung_up() => format!("{name}: {error}: check the hub's power and its cable"),
            _ => format!("{name}: {error}"),
        })
    }
}
