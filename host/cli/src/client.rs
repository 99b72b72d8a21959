//! `motor-hub client`: a command line for a real or simulated hub.

mod base;
mod coefficients;
mod devices;
mod drive;
mod faults;
mod hub;
mod identify;
pub(crate) mod interrupt;
mod jog;
mod motion;
mod motors_off;
pub(crate) mod ports;
mod readings;
mod record;
mod scan;
mod setting_options;
mod settings;
mod setup;
mod shaft_speed;
mod status;
mod together;
mod tune;
mod update;
mod watch;

use crate::output::{Failure, print, print_as};
use crate::parse::{MotorName, address, motor, whole};
use hub::HubOptions;
use motor_hub::protocol::{Address, Colour};
use motor_hub_client::Session;
use motors_off::disable_left_enabled;
use serde_json::json;
use studies::table;

/// Commands for a hub that speaks the REV Hub Serial Protocol, real or simulated
///
/// Without --address the hub on the line is found by discovery. A hub behind that hub is named by --address, or with
/// the motor: 3:0 is motor 0 of the hub at address 3.
///
/// A command that runs motors disables them when it ends: normally, after an error, after a panic, or by Ctrl-C,
/// SIGTERM, SIGQUIT or SIGHUP (closed terminal, unless `nohup` has started the command). Ctrl-Z also ends the command,
/// instead of suspending it. Unless the command ended normally, standard error names the motors that it has disabled.
/// After SIGKILL, and after the console window of Windows is closed, the hub receives nothing more, and disables all
/// motors after its keep-alive timeout of 2.5 s. `stop` disables all motors immediately.
///
/// Any packet resets the hub's keep-alive. Each command, also `status` and `watch`, therefore first disables motors
/// that it finds enabled, and names these motors on standard error. A line has one host at a time, so the host that
/// enabled the motors is gone.
///
/// Exit codes: 0 done; 1 no answer, a refusal, or a position or velocity that was not reached; 2 wrong options.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    hub: HubOptions,
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Lists the serial ports of this machine
    Ports {
        /// JSON instead of text
        #[arg(long)]
        json: bool,
    },
    Scan(scan::Options),
    /// Lists all hubs on the line
    Discover {
        /// JSON instead of a table
        #[arg(long)]
        json: bool,
    },
    Status(status::Options),
    Faults(faults::Options),
    #[command(flatten)]
    Drive(drive::Drive),
    Record(record::Options),
    Jog(jog::Options),
    Together(together::Options),
    #[command(name = "drive")]
    DriveBase(base::Options),
    /// Shows where the drive base is: position and heading since the base was configured, on hubs of this project
    Odometry {
        /// JSON instead of text
        #[arg(long)]
        json: bool,
    },
    /// Disables all motors of all hubs on the line immediately (fail-safe); with --address, of one hub
    Stop,
    Coefficients(coefficients::Options),
    Setup(setup::Options),
    Settings(settings::Options),
    Update(update::Options),
    Identify(identify::Options),
    Tune(tune::Options),
    Servo(devices::ServoOptions),
    /// Shows the analog inputs, the 5 V rail, the battery and the temperature
    Analog {
        /// JSON instead of a table
        #[arg(long)]
        json: bool,
    },
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
    Watch(watch::Options),
}

impl Options {
    pub(crate) fn execute(self) -> Result<(), Failure> {
        let Self { hub, command } = self;
        command.execute(&hub).map_err(|failure| hub.explain(failure))
    }
}

impl Command {
    /// Runs the command. Each command checks its options before it opens a session.
    fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let done = match self {
            Self::Ports { json } => return ports::show(json),
            Self::Scan(options) => return options.execute(hub.places(), hub.timeout()),
            Self::Discover { json } => return discover(hub.session_of_line()?, json),
            Self::Status(options) => return options.execute(hub),
            Self::Faults(options) => return options.execute(hub),
            Self::Drive(drive) => return drive.execute(hub),
            Self::Record(options) => return options.execute(hub),
            Self::Jog(options) => return options.execute(hub),
            Self::Together(options) => return options.execute(hub),
            Self::DriveBase(options) => return options.execute(hub),
            Self::Odometry { json } => return base::odometry(hub, json),
            Self::Coefficients(options) => return options.execute(hub),
            Self::Setup(options) => return options.execute(hub),
            Self::Settings(options) => return options.execute(hub),
            Self::Update(options) => return options.execute(hub),
            Self::Identify(options) => return options.execute(hub),
            Self::Tune(options) => return options.execute(hub),
            Self::Watch(options) => return options.execute(hub),
            Self::Servo(options) => return options.execute(hub),
            Self::Analog { json } => return devices::analog(hub, json),
            Self::Digital(options) => return options.execute(hub),
            Self::I2c { what } => return what.execute(hub),
            Self::Stop if hub.address.is_some() => {
                hub.session(None)?.fail_safe()?;
                "all motors are disabled".to_owned()
            }
            Self::Stop => {
                let stopped = hub.session_of_line()?.stop_all()?;
                let stopped: Vec<String> = stopped.iter().map(u8::to_string).collect();
                match stopped.as_slice() {
                    [_] => "all motors are disabled".to_owned(),
                    _ => format!("all motors of the hubs {} are disabled", stopped.join(", ")),
                }
            }
            Self::ResetEncoder { motor: MotorName { hub: named, number: motor } } => {
                hub.open(named)?.reset_encoder(motor)?;
                format!("motor {motor} is at 0 counts")
            }
            Self::Led { red, green, blue } => {
                hub.open(None)?.set_led(Colour { red, green, blue })?;
                format!("the LED is {red} {green} {blue}")
            }
            Self::SetAddress { new } => {
                let session = &mut hub.open(None)?;
                let (own, new_address) = (session.address(), new.get());
                if new_address != own && session.discover()?.iter().any(|hub| hub.address == new_address) {
                    return Err(Failure::Work(format!(
                        "another hub on the line has address {new_address}: choose another address"
                    )));
                }
                session.set_address(new)?;
                let until = session.why_address_is_lost()?;
                let until = until.map_or_else(String::new, |why| format!(" {why}"));
                format!("the hub's address is {}{until}", new.get())
            }
        };
        print(&format!("{done}\n"))
    }
}

/// Lists all hubs on the line, and disables their enabled motors.
fn discover(mut session: Session, json: bool) -> Result<(), Failure> {
    let mut table = table::new(&["address", "hub"], 0);
    let (mut hubs, mut disabled) = (Vec::new(), Ok(()));
    for hub in session.discover()? {
        if let Some(address) = Address::new(hub.address).filter(|_| !hub.duplicate) {
            session.select_hub(address);
            disabled = disabled.and(disable_left_enabled(&mut session));
        }
        let kind = scan::kind(&hub);
        table.add_row([hub.address.to_string(), kind.to_owned()]);
        hubs.push(json!({ "address": hub.address, "kind": kind }));
    }
    print_as(json, &json!({ "hubs": hubs }), table)?;
    // Motors of a hub that has not answered may run.
    Ok(disabled?)
}
