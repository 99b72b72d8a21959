//! `motor-hub client`: a command line for a real or simulated hub.

mod coefficients;
mod devices;
mod drive;
mod error;
mod faults;
mod identify;
pub(crate) mod interrupt;
mod jog;
mod motion;
mod motors_off;
mod ports;
mod readings;
mod record;
mod scan;
mod settings;
mod setup;
mod shaft_speed;
mod status;
mod together;
mod tune;
mod update;
mod watch;

use crate::output::{Failure, print, print_json};
use crate::parse::{MotorName, address, host_and_port, motor, whole};
use clap::builder::NonEmptyStringValueParser;
use error::ClientError;
use motor_hub::protocol::{Address, Colour};
use motor_hub_client::line::Line;
use motor_hub_client::{Error, Session};
use motors_off::stop_abandoned;
use serde_json::json;
use std::time::Duration;
use studies::table;

/// Text of the long help.
pub(crate) const HELP: &str = "\
Commands for a hub that speaks the REV Hub Serial Protocol, real or simulated

Without --address the hub on the line is found by discovery. A hub behind that hub is named by --address, or with the motor: \
3:0 is motor 0 of the hub at address 3.

A command that runs motors disables them when it ends: normally, after an error, after a panic, or by Ctrl-C, SIGTERM, \
SIGQUIT or SIGHUP (closed terminal). Ctrl-Z ends it too, instead of suspending it. It reports that on standard error, unless \
it ended normally. After SIGKILL, and after the console window of Windows is closed, the hub receives nothing more, and \
disables all motors after its keep-alive timeout of 2.5 s. `stop` disables all motors immediately.

Any packet resets the hub's keep-alive. Each command, also `status` and `watch`, therefore first disables motors that it \
finds enabled, and reports that. A line has one host at a time, so the host that enabled them is gone.

Exit codes: 0 done; 1 no answer, a refusal, or a position or velocity that was not reached; 2 wrong options.";

/// Line and address of the hub, and the command.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Serial port of the hub, or a pseudo-terminal (460800 baud, 8N1)
    #[arg(long, value_name = "PATH", global = true, help_heading = "Hub", value_parser = NonEmptyStringValueParser::new())]
    port: Option<String>,
    /// TCP address of the hub, instead of --port
    #[arg(long, value_name = "HOST:PORT", global = true, help_heading = "Hub", value_parser = host_and_port)]
    tcp: Option<String>,
    /// Address of the hub, 1 to 254 [default: found by discovery]
    #[arg(long, value_name = "N", global = true, help_heading = "Hub", value_parser = address)]
    address: Option<Address>,
    /// Time-out for an answer in milliseconds; within it a request is sent up to three times
    #[arg(
        long = "timeout-ms",
        alias = "timeout",
        value_name = "MS",
        global = true,
        help_heading = "Hub",
        default_value_t = 1000
    )]
    #[arg(value_parser = whole("a timeout", 10..=60_000_u64, "ms"))]
    timeout: u64,
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Lists the serial ports of this machine
    Ports(ports::Options),
    /// Looks for hubs on all serial ports of this machine and at given places
    #[command(long_about = scan::HELP)]
    Scan(scan::Options),
    /// Lists all hubs on the line
    Discover {
        /// JSON instead of a table
        #[arg(long)]
        json: bool,
    },
    /// Shows status, version, battery, LED and all motors; disables running motors first
    Status(status::Options),
    /// Lists the last faults and resets, on hubs of this project
    #[command(long_about = faults::HELP)]
    Faults(faults::Options),
    #[command(flatten)]
    Drive(drive::Drive),
    /// Drives motors as the four commands above, and records the values: CSV, and a chart of each motor
    #[command(long_about = record::HELP)]
    Record(record::Options),
    /// Drives motors by keys, while a key is held
    #[command(long_about = jog::help(), verbatim_doc_comment)]
    Jog(jog::Options),
    /// Moves motors in step to positions, or at speeds, then disables them, on hubs of this project
    ///
    /// All motors travel in proportion. If a motor lags, the others wait for it.
    Together(together::Options),
    /// Disables all motors of all hubs on the line immediately (fail-safe); with --address, of one hub
    Stop,
    /// Reads a loop's coefficients, or sets the given ones and keeps the others
    Coefficients(coefficients::Options),
    /// Shows or configures the connected motor and its control, on hubs of this project
    ///
    /// A change of motor, constants, scheme or duty also resets coefficients and motion to that motor's defaults. Settings
    /// are lost at a reset unless they are saved: see `settings`.
    Setup(setup::Options),
    /// Shows, saves, loads, resets, exports or imports stored settings, on hubs of this project
    #[command(long_about = settings::HELP)]
    Settings(settings::Options),
    /// Sends new firmware to a hub with a bootloader, starts it, and waits until it has confirmed itself
    #[command(long_about = update::HELP)]
    Update(update::Options),
    /// Identifies a motor, compares it with the catalogue, and proposes settings, on hubs of this project
    #[command(long_about = identify::HELP)]
    Identify(identify::Options),
    /// Configures a new motor: sets it up, identifies it, applies and stores the result, on hubs of this project
    #[command(long_about = tune::HELP)]
    Tune(tune::Options),
    /// Shows the servo outputs, or gives a servo pulses until the command ends
    Servo(devices::ServoOptions),
    /// Shows the analog inputs, the 5 V rail, the battery and the temperature
    Analog(devices::AnalogOptions),
    /// Shows the digital pins, or drives a pin until the command ends
    Digital(devices::DigitalOptions),
    /// Finds, reads and writes devices on the I2C buses
    I2c {
        #[command(subcommand)]
        what: devices::I2c,
    },
    /// Makes a motor's present position 0
    ResetEncoder {
        #[arg(value_parser = motor)]
        motor: MotorName,
    },
    /// Sets the colour of the status LED, each 0 to 255
    Led {
        #[arg(value_parser = whole("a colour", 0..=u8::MAX, ""))]
        red: u8,
        #[arg(value_parser = whole("a colour", 0..=u8::MAX, ""))]
        green: u8,
        #[arg(value_parser = whole("a colour", 0..=u8::MAX, ""))]
        blue: u8,
    },
    /// Changes the hub's address, 1 to 254; a hub that stores settings keeps it
    SetAddress {
        #[arg(value_name = "N", value_parser = address)]
        new: Address,
    },
    /// Shows positions, velocities, battery and status repeatedly; disables running motors first
    Watch(watch::Options),
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        match &self.command {
            Command::Ports(options) => return options.execute(),
            Command::Scan(options) => {
                let named = self.port.iter().chain(&self.tcp).cloned();
                return options.execute(named, Duration::from_millis(self.timeout));
            }
            _ => (),
        }
        // Check the options before anything is sent.
        match &self.command {
            Command::Drive(drive) => drop(drive.order()?),
            Command::Record(options) => options.check()?,
            Command::Together(options) => options.check()?,
            Command::Coefficients(options) => options.check()?,
            Command::Setup(options) => options.check()?,
            Command::Settings(options) => options.check()?,
            Command::Tune(options) => options.check()?,
            Command::Update(options) => options.check()?,
            _ => (),
        }
        let hub = self.hub()?;
        let timeout = Duration::from_millis(self.timeout);
        let (name, line) = match (&self.port, &self.tcp) {
            (Some(path), None) => (path, Line::serial(path)),
            (None, Some(address)) => (address, Line::tcp(address, timeout)),
            (Some(_), Some(_)) => return Err(Failure::Input("--port and --tcp exclude each other".into())),
            (None, None) => {
                let found = ports::list().unwrap_or_default();
                let text = format!("no hub given: give --port PATH or --tcp HOST:PORT\n{found}");
                return Err(Failure::Input(text.trim_end().to_owned()));
            }
        };
        let line = line.map_err(|error| Failure::Work(ports::unopened(name, &error)))?;
        self.command.execute(line, hub, timeout).map_err(|trouble| match trouble {
            ClientError::Hub(error @ Error::Parents { .. }) => {
                Failure::Work(format!("{name}: {error}; choose a hub by --address"))
            }
            ClientError::Hub(error) if self.tcp.is_some() && error.is_hung_up() => Failure::Work(format!(
                "{name}: {error}; a served hub accepts one host at a time: check that no other host uses it, and that it still runs"
            )),
            ClientError::Hub(error) => Failure::Work(format!("{name}: {error}")),
            ClientError::Other(failure) => failure,
        })
    }
}

impl Options {
    /// The hub that is meant: the one of --address, or the one of the motors. `None` for the hub on the line.
    fn hub(&self) -> Result<Option<Address>, Failure> {
        let of_motors = match &self.command {
            Command::Drive(drive) => drive.hub(),
            Command::Record(options) => options.hub()?,
            Command::Together(options) => options.hub().map_err(Failure::Input)?,
            Command::Coefficients(options) => options.motor.hub,
            Command::Setup(options) => options.motor.hub,
            Command::Identify(options) => options.motor.hub,
            Command::Tune(options) => options.motor.hub,
            Command::ResetEncoder { motor } => motor.hub,
            _ => None,
        };
        match (self.address, of_motors) {
            (Some(given), Some(named)) if given != named => Err(Failure::Input(format!(
                "--address {} and a motor of the hub at address {} exclude each other",
                given.get(),
                named.get()
            ))),
            (given, named) => Ok(given.or(named)),
        }
    }
}

impl Command {
    fn execute(self, line: Line, address: Option<Address>, timeout: Duration) -> Result<(), ClientError> {
        if let Self::Discover { json } = self {
            return discover(Session::new(line, Address::DEFAULT, timeout), json);
        }
        if matches!(self, Self::Stop) && address.is_none() {
            let stopped = Session::new(line, Address::DEFAULT, timeout).stop_all()?;
            let stopped: Vec<String> = stopped.iter().map(u8::to_string).collect();
            return Ok(match stopped.as_slice() {
                [_] => print("all motors are disabled\n"),
                _ => print(&format!("all motors of the hubs {} are disabled\n", stopped.join(", "))),
            }?);
        }
        let mut session = match address {
            Some(address) => Session::new(line, address, timeout),
            None => Session::with_parent(line, timeout)?,
        };
        if !matches!(self, Self::Stop) {
            stop_abandoned(&mut session)?;
        }
        let done = match self {
            // These commands need no session and returned above.
            Self::Ports(_) | Self::Scan(_) | Self::Discover { .. } => return Ok(()),
            Self::Status(options) => return options.execute(&mut session),
            Self::Faults(options) => return options.execute(&mut session),
            Self::Drive(drive) => return drive.execute(&mut session),
            Self::Record(options) => return options.execute(&mut session),
            Self::Jog(options) => return options.execute(&mut session),
            Self::Together(options) => return options.execute(&mut session),
            Self::Coefficients(options) => return options.execute(&mut session),
            Self::Setup(options) => return options.execute(&mut session),
            Self::Settings(options) => return options.execute(&mut session),
            Self::Update(options) => return options.execute(&mut session),
            Self::Identify(options) => return options.execute(&mut session),
            Self::Tune(options) => return options.execute(&mut session),
            Self::Watch(options) => return options.execute(&mut session),
            Self::Servo(options) => return options.execute(&mut session),
            Self::Analog(options) => return options.execute(&mut session),
            Self::Digital(options) => return options.execute(&mut session),
            Self::I2c { what } => return what.execute(&mut session),
            Self::Stop => {
                session.fail_safe()?;
                "all motors are disabled".to_owned()
            }
            Self::ResetEncoder { motor: MotorName { number: motor, .. } } => {
                session.reset_encoder(motor)?;
                format!("motor {motor} is at 0 counts")
            }
            Self::Led { red, green, blue } => {
                session.set_led(Colour { red, green, blue })?;
                format!("the LED is {red} {green} {blue}")
            }
            Self::SetAddress { new } => {
                session.set_address(new)?;
                let until = settings::why_address_is_lost(&mut session)?;
                let until = until.map_or_else(String::new, |why| format!(" until the next reset: {why}"));
                format!("the hub's address is {}{until}", new.get())
            }
        };
        Ok(print(&format!("{done}\n"))?)
    }
}

/// Lists all hubs on the line, and disables the motors that they have enabled.
fn discover(mut session: Session<Line>, json: bool) -> Result<(), ClientError> {
    let mut table = table::new(&["address", "hub"], 0);
    let mut hubs = Vec::new();
    for hub in session.discover()? {
        if let Some(address) = Address::new(hub.address).filter(|_| !hub.clashing) {
            session.talk_to(address);
            stop_abandoned(&mut session)?;
        }
        let kind = scan::kind(&hub);
        table.add_row([hub.address.to_string(), kind.to_owned()]);
        hubs.push(json!({ "address": hub.address, "kind": kind }));
    }
    Ok(if json { print_json(&json!({ "hubs": hubs })) } else { print(&format!("{table}\n")) }?)
}
