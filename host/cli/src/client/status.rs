//! `motor-hub client status`.

use super::Trouble;
use crate::output::{print, print_json};
use motor_hub::link::{CHANNELS, Colour};
use motor_hub::units::{Control, Millivolts};
use motor_hub_client::line::Line;
use motor_hub_client::motor::Channel;
use motor_hub_client::state::{Bulk, Status};
use motor_hub_client::wire::Refusal;
use motor_hub_client::{Error, Session};
use serde_json::{Value, json};
use studies::table;

/// In which form.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// JSON instead of tables
    #[arg(long)]
    json: bool,
    /// The hub forgets what its status word says after it has said it
    #[arg(long)]
    clear: bool,
}

/// All that a hub tells.
struct Everything {
    address: u8,
    status: Status,
    version: String,
    battery: Millivolts,
    led: Colour,
    channels: Vec<Channel>,
    bulk: Bulk,
}

impl Options {
    pub(crate) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let hub = Everything::read(session, self.clear)?;
        let printed = if self.json { print_json(&hub.json()) } else { print(&hub.text()) };
        Ok(printed?)
    }
}

impl Everything {
    fn read(session: &mut Session<Line>, clear: bool) -> Result<Self, Error> {
        let (version, battery, led) = (session.version()?, session.battery()?, session.led()?);
        let mut channels = Vec::new();
        for motor in (0..).take(CHANNELS) {
            match session.channel(motor) {
                // A hub with fewer motors.
                Err(Error::Refused { reason: Refusal::NO_SUCH_CHANNEL, .. }) => break,
                channel => channels.push(channel?),
            }
        }
        let bulk = session.bulk()?;
        // Last, so that it is cleared only by a command that goes on to show it.
        let status = session.status(clear)?;
        Ok(Self { address: session.address(), status, version, battery, led, channels, bulk })
    }

    /// Of each motor: number, channel, encoder, velocity, at target.
    fn motors(&self) -> impl Iterator<Item = (usize, &Channel, i32, i16, bool)> {
        let Bulk { encoders, velocities, at_target, .. } = self.bulk;
        let motors = self.channels.iter().enumerate().zip(encoders).zip(velocities).zip(at_target);
        motors.map(|((((index, channel), encoder), velocity), at)| (index, channel, encoder, velocity, at))
    }

    fn battery_v(&self) -> f64 {
        f64::from(self.battery.get()) / 1000.0
    }

    fn text(&self) -> String {
        let or = |words: String, none: &str| if words.is_empty() { none.to_owned() } else { words };
        let Colour { red, green, blue } = self.led;
        let mut head = table::new(&["hub", &self.address.to_string()], 2);
        head.add_row(["status", &or(self.status.words().join(", "), "all well")])
            .add_row(["motor alerts", &or(self.status.alert_words().join(", "), "none")])
            .add_row(["version", &self.version])
            .add_row(["battery", &format!("{:.3} V", self.battery_v())])
            .add_row(["LED", &format!("red {red}, green {green}, blue {blue}")]);
        let mut motors = table::new(&MOTOR_HEADINGS, 3);
        for (index, channel, encoder, velocity, at_target) in self.motors() {
            motors.add_row([
                index.to_string(),
                mode(channel.mode),
                zero_behaviour(channel.zero_behaviour),
                yes(channel.enabled),
                format!("{:.4}", share(channel.power)),
                channel.velocity.to_string(),
                format!("{} ±{}", channel.position, channel.tolerance),
                encoder.to_string(),
                velocity.to_string(),
                yes(at_target),
            ]);
        }
        format!("{head}\nVelocities in counts/s, positions in counts\n{motors}\n")
    }

    fn json(&self) -> Value {
        let motors: Vec<Value> = self
            .motors()
            .map(|(index, channel, encoder, velocity, at_target)| {
                json!({
                    "motor": index,
                    "mode": mode(channel.mode),
                    "zero_behaviour": zero_behaviour(channel.zero_behaviour),
                    "enabled": channel.enabled,
                    "power": share(channel.power),
                    "target_velocity": channel.velocity,
                    "target_position": channel.position,
                    "tolerance": channel.tolerance,
                    "position": encoder,
                    "velocity": velocity,
                    "at_target": at_target,
                })
            })
            .collect();
        let Colour { red, green, blue } = self.led;
        json!({
            "address": self.address,
            "status": self.status.words(),
            "motor_alerts": self.status.alert_words(),
            "attention": self.bulk.attention,
            "version": self.version,
            "battery_v": self.battery_v(),
            "led": { "red": red, "green": green, "blue": blue },
            "motors": motors,
        })
    }
}

const MOTOR_HEADINGS: [&str; 10] = [
    "motor",
    "mode",
    "at zero",
    "enabled",
    "power",
    "target velocity",
    "target position",
    "encoder",
    "velocity",
    "at target",
];

fn mode(mode: u8) -> String {
    match mode {
        0 => "power".to_owned(),
        1 => "velocity".to_owned(),
        2 => "position".to_owned(),
        unknown => format!("mode {unknown}"),
    }
}

fn zero_behaviour(behaviour: u8) -> String {
    match behaviour {
        0 => "brake".to_owned(),
        1 => "float".to_owned(),
        unknown => format!("behaviour {unknown}"),
    }
}

fn yes(yes: bool) -> String {
    if yes { "yes" } else { "no" }.to_owned()
}

/// -1 to 1.
fn share(power: i16) -> f64 {
    f64::from(power) / f64::from(Control::MAX.get())
}
