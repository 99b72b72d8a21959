//! `motor-hub client power`, `velocity` and `position`: motors that run while the command does.

use super::interrupt;
use super::live::{Live, Reading, repeat};
use super::trouble::Trouble;
use crate::output::{Failure, print};
use crate::parse::{channel, within_a_day};
use motor_hub::motor::ZeroPower;
use motor_hub::protocol::motor::RunMode;
use motor_hub::units::Control;
use motor_hub_client::line::Line;
use motor_hub_client::{Error, Session};
use std::collections::BTreeSet;
use std::time::Duration;

/// The motors that the protocol knows.
pub(crate) const ALL: [u8; motor_hub::protocol::CHANNELS] = [0, 1, 2, 3];

/// Ten readings a second, which are far more than the hub's keep-alive needs.
pub(crate) const INTERVAL: Duration = Duration::from_millis(100);

/// Readings a line, where output is no terminal.
pub(crate) const LINE: u32 = 10;

/// In a row, and no faster than this, so that a motor that rushes through its target is not taken for one
/// that is there: two counts in the hub's control period.
const READINGS_AT_TARGET: u32 = 2;
const STANDING_CPS: u16 = 40;

/// Motors, and for how long.
#[derive(clap::Args)]
struct Common {
    /// Motor 0 to 3, several as 0,2 or all
    #[arg(value_name = "MOTOR", value_parser = motors)]
    motors: Motors,
    /// Ends after so many seconds
    #[arg(long = "for", value_name = "SECONDS", allow_negative_numbers = true, value_parser = within_a_day)]
    length: Option<Duration>,
    /// At zero the motors float; otherwise they brake
    #[arg(long)]
    float: bool,
}

#[derive(Clone)]
struct Motors(Vec<u8>);

fn motors(text: &str) -> Result<Motors, String> {
    if text == "all" {
        return Ok(Motors(ALL.to_vec()));
    }
    let motors: BTreeSet<u8> = text.split(',').map(channel).collect::<Result<_, _>>()?;
    Ok(Motors(motors.into_iter().collect()))
}

/// Options of `power`.
#[derive(clap::Args)]
pub(crate) struct PowerOptions {
    #[command(flatten)]
    common: Common,
    /// Share of full power, -1 to 1; positive counts up
    #[arg(value_name = "VALUE", allow_negative_numbers = true, value_parser = power)]
    value: Control,
}

fn power(text: &str) -> Result<Control, String> {
    let share = text.parse().ok().filter(|share: &f64| (-1.0..=1.0).contains(share));
    let power = share.map(|share| Control::new((share * f64::from(Control::MAX.get())).round() as i16));
    power.ok_or("a power is -1 to 1".to_owned())
}

fn counts_per_second(text: &str) -> Result<i16, String> {
    text.parse().map_err(|_| "a velocity is a whole number from -32768 to 32767".to_owned())
}

/// Options of `velocity`.
#[derive(clap::Args)]
pub(crate) struct VelocityOptions {
    #[command(flatten)]
    common: Common,
    /// Counts per second, -32768 to 32767
    #[arg(value_name = "CPS", allow_negative_numbers = true, value_parser = counts_per_second)]
    cps: i16,
}

/// Options of `position`.
#[derive(clap::Args)]
pub(crate) struct PositionOptions {
    #[command(flatten)]
    common: Common,
    /// Where to go
    #[arg(value_name = "COUNTS", allow_negative_numbers = true)]
    counts: i32,
    /// Counts from there that are near enough
    #[arg(long, value_name = "COUNTS", default_value_t = 5)]
    tolerance: u16,
    /// Speed limit on the way, in counts per second
    #[arg(long, value_name = "CPS", default_value_t = 1000, allow_negative_numbers = true)]
    #[arg(value_parser = clap::value_parser!(i16).range(1..))]
    speed: i16,
}

impl PowerOptions {
    pub(crate) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let set = |session: &mut Session<Line>, motor| session.set_power(motor, self.value);
        self.common.run(session, RunMode::Power, set, |_| false).map(drop)
    }
}

impl VelocityOptions {
    pub(crate) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let set = |session: &mut Session<Line>, motor| session.set_velocity(motor, self.cps);
        self.common.run(session, RunMode::Velocity, set, |_| false).map(drop)
    }
}

impl PositionOptions {
    pub(crate) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let Self { common, counts, tolerance, speed } = self;
        let mut in_a_row = 0;
        let set = |session: &mut Session<Line>, motor| {
            session.set_velocity(motor, speed)?;
            session.set_position(motor, counts, tolerance)
        };
        let arrived = |reading: &Reading| {
            let all = reading
                .motors(&common.motors.0)
                .all(|(_, _, velocity, at_target)| at_target && velocity.unsigned_abs() <= STANDING_CPS);
            in_a_row = if all { in_a_row + 1 } else { 0 };
            in_a_row >= READINGS_AT_TARGET
        };
        if common.run(session, RunMode::Position, set, arrived)? {
            return Ok(print("at target\n")?);
        }
        let seconds = common.length.unwrap_or_default().as_secs_f64();
        Err(Failure::Work(format!("not at the target after {seconds} s")).into())
    }
}

impl Common {
    /// Sets the motors going, shows what they do until `arrived` says true or the time is over, and
    /// disables them. True if they have arrived.
    fn run(
        &self,
        session: &mut Session<Line>,
        mode: RunMode,
        set: impl Fn(&mut Session<Line>, u8) -> Result<(), Error>,
        arrived: impl FnMut(&Reading) -> bool,
    ) -> Result<bool, Trouble> {
        interrupt::listen()?;
        let zero = if self.float { ZeroPower::Float } else { ZeroPower::Brake };
        for motor in &self.motors.0 {
            session.set_mode(*motor, mode, zero)?;
            set(session, *motor)?;
        }
        let mut enabled = Vec::new();
        let done = self.enable(session, &mut enabled).and_then(|()| self.follow(session, arrived));
        // All of them, whatever has gone wrong before or does so with one of them.
        let disabled = enabled.iter().map(|motor| session.enable(*motor, false));
        let disabled = disabled.fold(Ok(()), Result::and);
        let arrived = done?;
        disabled?;
        Ok(arrived)
    }

    /// `enabled` are those that may be, even if the last one's answer got lost.
    fn enable(&self, session: &mut Session<Line>, enabled: &mut Vec<u8>) -> Result<(), Trouble> {
        for motor in &self.motors.0 {
            enabled.push(*motor);
            session.enable(*motor, true)?;
        }
        Ok(())
    }

    fn follow(
        &self,
        session: &mut Session<Line>,
        mut arrived: impl FnMut(&Reading) -> bool,
    ) -> Result<bool, Trouble> {
        let Motors(motors) = &self.motors;
        let mut live = Live::new();
        let mut readings = 0u32;
        let mut unsaid = None;
        let done = repeat(session, INTERVAL, self.length, |session, reading| {
            let line = reading.line(motors);
            unsaid = None;
            if live.terminal {
                live.redraw(&reading.table(motors))?;
            } else if readings.is_multiple_of(LINE) {
                print(&line)?;
            } else {
                unsaid = Some(line);
            }
            readings = readings.wrapping_add(1);
            for motor in motors {
                // Fail-safe, a reset, another host.
                if !session.enabled(*motor)? {
                    let words = reading.status.words().join(", ");
                    let says = format!("the hub has let motor {motor} go; its status: {words}");
                    return Err(Failure::Work(says).into());
                }
            }
            Ok(arrived(reading))
        });
        // The last reading is what it came to.
        unsaid.map_or(Ok(()), |line| print(&line))?;
        done
    }
}
