//! `motor-hub client jog`: drives motors by keys.

mod keys;
#[cfg(unix)]
mod terminal;

use super::drive::ALL;
use super::hub::HubOptions;
use super::interrupt;
use super::motion::{check_enabled, warn_of};
use super::motors_off::{DrivingSession, report};
use super::readings::{Live, MotorReading, motors_of};
use crate::output::{Failure, print};
use crate::parse::{number, share, whole};
use keys::{Jog, Key};
use motor_hub::motor::ZeroPower;
use motor_hub::protocol::answers::Bulk;
use motor_hub::units::Control;
use motor_hub_client::Error;
use motor_hub_client::motor::Setpoint;
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::time::{Duration, Instant};
use studies::table;

const KEYS: &str = "\
\x20 up, k, +       forward            0 to 3, a   choose a motor; all
  down, j, -     backward           space, Esc  disable all motors
  right, l, >    faster             q, Ctrl-C   disable all motors, end
  left, h, <     slower";

const WORDS: &str = "\
A terminal repeats a key that is held. After --hold-s seconds without a key the motors are regulated to a stop, also when a \
remote connection hangs. The terminal is restored at the end, except after SIGKILL.";

fn help() -> String {
    format!("Drives motors by keys, while a key is held\n\n{KEYS}\n\n{WORDS}")
}

/// Drives motors by keys, while a key is held
#[derive(clap::Args)]
#[command(long_about = help(), verbatim_doc_comment)]
pub(super) struct Options {
    /// Initial speed in counts per second
    #[arg(long = "speed-cps", alias = "speed", value_name = "CPS", default_value_t = 300)]
    #[arg(value_parser = whole("a speed", 1..=i16::MAX, "counts/s"))]
    speed: i16,
    /// Drives with constant power instead, a share above 0 and at most 1; works without an encoder
    #[arg(long, value_name = "SHARE", conflicts_with = "speed", value_parser = some_power)]
    power: Option<Control>,
    /// Time that a key press drives, 0.1 to 5 s; must exceed the terminal's delay of repeated keys
    #[arg(long = "hold-s", alias = "hold", value_name = "S", default_value_t = 0.7)]
    #[arg(value_parser = number("the time that a key drives", 0.1..=5.0, "s"))]
    hold: f64,
}

fn some_power(text: &str) -> Result<Control, &'static str> {
    share(text).filter(|power| power.get() > 0).ok_or("the power is a share above 0 and at most 1")
}

/// Longest wait for a key before the hub is read again.
const LOOK: Duration = Duration::from_millis(50);

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let session = &mut hub.open(None)?;
        let level = self.power.map_or(self.speed, Control::get);
        let mut jog = Jog::new(level, Duration::from_secs_f64(self.hold));
        let stopped = DrivingSession::run(session, |session| {
            if self.power.is_none() {
                let speed = u32::from(self.speed.unsigned_abs());
                warn_of(session, &ALL.map(|motor| (motor, speed)))?;
            }
            print(&format!("{KEYS}\n\n{}\n\n", table::paragraph(WORDS)))?;
            let (_raw, keys) = open()?;
            self.follow(session, &mut jog, &keys)?;
            session.stop()
        })?;
        report(Ok(stopped));
        Ok(())
    }

    fn follow(
        &self,
        session: &mut DrivingSession<'_>,
        jog: &mut Jog,
        keys: &Receiver<Vec<u8>>,
    ) -> Result<(), Failure> {
        let mut sent = [None; ALL.len()];
        let mut live = Live::new();
        loop {
            let now = Instant::now();
            match keys.recv_timeout(LOOK) {
                Ok(bytes) => {
                    for key in keys::read(&bytes) {
                        if key == Key::Quit {
                            return Ok(());
                        }
                        jog.press(key, Instant::now());
                    }
                }
                // The terminal is gone.
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
                Err(RecvTimeoutError::Timeout) => (),
            }
            interrupt::wait(now)?;
            let wanted = jog.at(Instant::now());
            for ((motor, sent), wanted) in ALL.into_iter().zip(&mut sent).zip(wanted) {
                if *sent != wanted {
                    self.send(session, motor, *sent, wanted)?;
                    *sent = wanted;
                } else if sent.is_some() {
                    check_enabled(session, motor)?;
                }
            }
            // A raw terminal does not add a carriage return to a line feed.
            live.redraw(&self.text(jog, &session.bulk()?).replace('\n', "\r\n"))?;
        }
    }

    /// Sends a motor its new level, or disables the motor if `wanted` is `None`.
    fn send(
        &self,
        session: &mut DrivingSession<'_>,
        motor: u8,
        before: Option<i16>,
        wanted: Option<i16>,
    ) -> Result<(), Error> {
        let Some(level) = wanted else { return session.disable(motor) };
        let setpoint = match self.power {
            Some(_) => Setpoint::Power(Control::new(level)),
            None => Setpoint::Velocity(level),
        };
        session.set_setpoint(motor, setpoint, ZeroPower::Brake)?;
        if before.is_none() { session.enable(motor) } else { Ok(()) }
    }

    /// Returns a text with a line for the level, and a line for each chosen motor.
    fn text(&self, jog: &Jog, bulk: &Bulk) -> String {
        let level = match self.power {
            Some(_) => format!("power {:.2}", f64::from(jog.level()) / f64::from(Control::MAX.get())),
            None => format!("{} counts/s", jog.level()),
        };
        let motors = motors_of(bulk, jog.motors());
        let motors = motors.map(|MotorReading { motor, position, velocity, .. }| {
            format!("motor {motor}: {position} counts, {velocity} counts/s\n")
        });
        format!("{level}\n{}", motors.collect::<String>())
    }
}

#[cfg(unix)]
fn open() -> Result<(terminal::Raw, Receiver<Vec<u8>>), Failure> {
    Ok((terminal::Raw::enter()?, terminal::keys()))
}

#[cfg(not(unix))]
fn open() -> Result<((), Receiver<Vec<u8>>), Failure> {
    Err(Failure::work("jog reads keys on Unix only"))
}
