//! `motor-hub client identify`.

use super::drive::{INTERVAL, LINE};
use super::driven::Driven;
use super::interrupt;
use super::live::Live;
use super::trouble::Trouble;
use crate::output::{Failure, print, print_json};
use crate::parse::{channel, whole};
use motor_hub::extension::settings::{Group, MotorSettings};
use motor_hub::motor::ZeroPower;
use motor_hub::protocol::motor::RunMode;
use motor_hub::regulator::identify::{Identification, Identified};
use motor_hub::units::Control;
use motor_hub_client::line::Line;
use motor_hub_client::{Error, Session};
use serde_json::json;
use std::time::{Duration, Instant};
use studies::identify::{self, found_table};

/// Longest wait for a braked motor to stand. A motor that still turns is driven by its load.
const LONGEST_REST: Duration = Duration::from_secs(5);
/// Time-out of an identification; the slowest motor needs half of it.
const LONGEST: Duration = Duration::from_secs(30);

/// Motor, travel limit, and use of the result.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Motor 0 to 3
    #[arg(value_parser = channel)]
    pub(super) motor: u8,
    /// Longest travel either way, in counts; a small limit makes the motion shorter [default: no limit]
    #[arg(long = "travel-counts", alias = "travel", value_name = "COUNTS", default_value_t = u32::MAX)]
    #[arg(hide_default_value = true, value_parser = whole("a travel", 0..=u32::MAX, "counts"))]
    travel: u32,
    /// Applies the result until the hub's reset; coefficients set by a host are dropped
    #[arg(long)]
    pub(super) apply: bool,
    /// JSON instead of a table
    #[arg(long)]
    pub(super) json: bool,
}

impl Options {
    pub(crate) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let outcome = self.learned(session)?;
        if let (Identification::Found(found), true) = (outcome, self.apply) {
            let mut settings = session.settings(self.motor)?;
            settings.motor.dynamics = Some(found.dynamics);
            apply(session, self.motor, &settings)?;
        }
        self.show(outcome)
    }

    /// Enables the motor, identifies it, and disables it.
    pub(super) fn learned(&self, session: &mut Session<Line>) -> Result<Identification, Trouble> {
        Driven::run(session, |driven| {
            driven.set_mode(self.motor, RunMode::Power, ZeroPower::Brake)?;
            driven.set_power(self.motor, Control::ZERO)?;
            driven.enable(self.motor)?;
            self.learn(driven)
        })
    }

    /// Waits until the braked motor stands. If the motor never stands, the hub refuses the identification.
    fn rest(&self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let end = Instant::now() + LONGEST_REST;
        let mut last = None;
        while Instant::now() < end {
            let place = session.bulk()?.encoders.get(usize::from(self.motor)).copied();
            if last == place {
                break;
            }
            last = place;
            interrupt::wait(Instant::now() + INTERVAL)?;
        }
        Ok(())
    }

    /// Starts the identification, and follows it to its end.
    fn learn(&self, session: &mut Session<Line>) -> Result<Identification, Trouble> {
        self.rest(session)?;
        let motor = self.motor;
        let travel = session.identify(motor, self.travel)?;
        // The motor rests for 0.2 s before it turns.
        self.say(&format!("motor {motor}: turns at most {travel} counts either way, for some 3 s\n"))?;
        let mut live = Live::new();
        let end = Instant::now() + LONGEST;
        for look in 1u32.. {
            interrupt::wait(Instant::now() + INTERVAL)?;
            let Identification::Running(percent) = session.identification(motor)? else { break };
            let progress = format!("{percent} %\n");
            if live.terminal && !self.json {
                live.redraw(&progress)?;
            } else if look.is_multiple_of(LINE) {
                self.say(&progress)?;
            }
            if Instant::now() > end {
                let seconds = LONGEST.as_secs();
                return Err(
                    Failure::Work(format!("motor {motor} was not identified within {seconds} s")).into()
                );
            }
        }
        Ok(session.identification(motor)?)
    }

    /// Prints a text, unless the output is JSON.
    fn say(&self, text: &str) -> Result<(), Failure> {
        if self.json { Ok(()) } else { print(text) }
    }

    fn show(&self, outcome: Identification) -> Result<(), Trouble> {
        let motor = self.motor;
        if self.json {
            let mut document = identify::json(outcome);
            if let Some(object) = document.as_object_mut() {
                let applied = self.apply && matches!(outcome, Identification::Found(_));
                object.extend([("motor".to_owned(), json!(motor)), ("applied".to_owned(), json!(applied))]);
            }
            print_json(&document)?;
        }
        let Identification::Found(found) = outcome else {
            let why = identify::words(outcome);
            return Err(Failure::Work(format!("motor {motor} was not identified: {why}")).into());
        };
        self.say(&self.found(&found))?;
        Ok(())
    }

    fn found(&self, found: &Identified) -> String {
        let table = found_table(&format!("motor {}", self.motor), found, None);
        let residual = f64::from(found.residual) / 10.0;
        let applied = if self.apply {
            "Applied: the hub regulates the motor by this result until its reset\n"
        } else {
            "Not applied; --apply puts the result in force\n"
        };
        format!("{table}\nResidual: {residual:.1} % of the changes of speed are not explained\n{applied}")
    }
}

/// Sets the motion of these settings. Coefficients of a host would override the model, so the set-up is sent too, which deletes
/// them.
pub(super) fn apply(session: &mut Session<Line>, motor: u8, settings: &MotorSettings) -> Result<(), Error> {
    session.set(motor, Group::SetUp, settings)?;
    session.set(motor, Group::Motion, settings)
}
