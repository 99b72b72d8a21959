//! What a hub does just now, shown again and again: a table in one place of a terminal, lines elsewhere.

use super::interrupt;
use super::trouble::Trouble;
use super::turn::shaft_speed;
use crate::output::{Failure, print};
use motor_hub::bridge::Drive;
use motor_hub::protocol::answers::{Bulk, MotorAlert, Status};
use motor_hub::protocol::report::{HubReport, MotorReport};
use motor_hub::units::{Control, Milliamperes, Millivolts};
use motor_hub_client::line::Line;
use motor_hub_client::why::why_still;
use motor_hub_client::{Error, Session};
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::time::{Duration, Instant};
use studies::points::{regime_name, regulator_name};
use studies::table;

/// What a hub does at one instant. To take it keeps the hub's motors alive.
pub(crate) struct Reading {
    pub(crate) at: Duration,
    pub(crate) bulk: Bulk,
    battery: Millivolts,
    pub(crate) status: Status,
    /// `None` of a hub that has no words for it.
    report: Option<HubReport>,
}

impl Reading {
    pub(crate) fn take(session: &mut Session<Line>, since: Instant) -> Result<Self, Error> {
        let bulk = session.bulk()?;
        let (battery, status) = (session.battery()?, session.status(false)?);
        let report = session.report()?;
        Ok(Self { at: since.elapsed(), bulk, battery, status, report })
    }

    pub(crate) fn motors(&self, motors: &[u8]) -> impl Iterator<Item = (u8, i32, i16, bool)> {
        motors_of(&self.bulk, motors)
    }

    fn reported(&self, motor: u8) -> Option<&MotorReport> {
        self.report.as_ref()?.motors.get(usize::from(motor))
    }

    /// Why a motor stands, if something is known to keep it.
    fn why(&self, motor: u8) -> Option<&'static str> {
        why_still(self.report.as_ref()?, motor.into())
    }

    fn battery_v(&self) -> f64 {
        f64::from(self.battery.get()) / 1000.0
    }

    /// Lines of text for a terminal. With so many counts in a turn of the output shaft speeds are of that too.
    pub(crate) fn table(&self, motors: &[u8], turn: Option<f64>) -> String {
        let mut headings = vec!["motor", "position, counts", "velocity, counts/s", "at target"];
        headings.extend(turn.iter().flat_map(|_| ["rpm", "rad/s"]));
        headings.extend(
            self.report.iter().flat_map(|_| ["control, %", "bridge", "current, A", "stands because"]),
        );
        let mut table = table::new(&headings, 0);
        for (motor, position, velocity, at_target) in self.motors(motors) {
            let at_target = if at_target { "yes" } else { "no" };
            let shaft = turn.map(|turn| shaft_speed(velocity, turn));
            let shaft = shaft.into_iter().flat_map(|(rpm, rad)| [format!("{rpm:.1}"), format!("{rad:.2}")]);
            let row = [motor.to_string(), position.to_string(), velocity.to_string(), at_target.into()];
            let told = self.reported(motor).map(|told| {
                let why = self.why(motor).unwrap_or_default().to_owned();
                [format!("{:.1}", percent(told)), bridge(told), format!("{:.2}", amperes(told.current)), why]
            });
            table.add_row(row.into_iter().chain(shaft).chain(told.into_iter().flatten()));
        }
        let (seconds, volts) = (self.at.as_secs_f64(), self.battery_v());
        format!("{seconds:.1} s, battery {volts:.2} V\n{}\n{table}\n", self.says())
    }

    /// Status and alerts in words.
    fn says(&self) -> String {
        let words = self.status.words().into_iter().map(str::to_owned);
        let words: Vec<String> = words.chain(alert_words(self.status)).collect();
        let attention = if self.bulk.attention == Some(true) { "attention: " } else { "status: " };
        attention.to_owned() + &if words.is_empty() { "all well".to_owned() } else { words.join(", ") }
    }

    /// One line of text.
    pub(crate) fn line(&self, motors: &[u8], turn: Option<f64>) -> String {
        let motors = self.motors(motors).map(|(motor, position, velocity, at_target)| {
            let at_target = if at_target { ", at target" } else { "" };
            let shaft = turn.map(|turn| shaft_speed(velocity, turn));
            let rpm = shaft.map(|(rpm, rad)| format!(" ({rpm:.1} rpm, {rad:.2} rad/s)")).unwrap_or_default();
            format!("; motor {motor}: {position} counts, {velocity} counts/s{rpm}{at_target}")
        });
        let motors: String = motors.collect();
        format!("{:.1} s, {:.2} V{motors}\n", self.at.as_secs_f64(), self.battery_v())
    }

    /// For programs: seconds, volts, counts, counts per second; with the counts of a turn, the shaft's speed.
    pub(crate) fn json(&self, motors: &[u8], turn: Option<f64>) -> Value {
        let motors: Vec<Value> = self
            .motors(motors)
            .map(|(motor, position, velocity, at_target)| {
                let mut of_motor =
                    json!({ "motor": motor, "position": position, "velocity": velocity, "at_target": at_target });
                if let (Some(object), Some(turn)) = (of_motor.as_object_mut(), turn) {
                    let (rpm, rad) = shaft_speed(velocity, turn);
                    object.extend([("rpm".to_owned(), json!(rpm)), ("rad_per_s".to_owned(), json!(rad))]);
                }
                if let (Some(object), Some(told)) = (of_motor.as_object_mut(), self.reported(motor)) {
                    object.extend(told_json(told));
                    object.insert("stands_because".to_owned(), self.why(motor).into());
                }
                of_motor
            })
            .collect();
        json!({
            "time_s": self.at.as_secs_f64(),
            "battery_v": self.battery_v(),
            "attention": self.bulk.attention,
            "status": &*self.status.words(),
            "motor_alerts": alert_words(self.status),
            "motors": motors,
        })
    }
}

/// Of full control.
fn percent(told: &MotorReport) -> f64 {
    100.0 * f64::from(told.control.get()) / f64::from(Control::MAX.get())
}

fn amperes(current: Milliamperes) -> f64 {
    f64::from(current.get()) / 1e3
}

/// Regime, mode and duty.
fn bridge(told: &MotorReport) -> String {
    let Drive { mode, duty } = told.drive;
    told.regime.map_or_else(
        || "open".to_owned(),
        |regime| format!("{} {} {:.0} %", regime_name(regime), mode.name(), 100.0 * duty.to_f64()),
    )
}

/// What hubs of this project tell of a motor beside what all of them do.
fn told_json(told: &MotorReport) -> [(String, Value); 8] {
    let regulator = regulator_name(told.regulator);
    [
        ("enabled", json!(told.enabled)),
        ("control", json!(told.control.get())),
        ("regime", json!(told.regime.map(regime_name))),
        ("mode", json!(told.regime.map(|_| told.drive.mode.name()))),
        ("duty", json!(told.drive.duty.to_f64())),
        ("current_a", json!(amperes(told.current))),
        ("load_a", json!(told.load.map(amperes))),
        ("regulator", json!(regulator)),
    ]
    .map(|(key, value)| (key.to_owned(), value))
}

/// Of these motors: motor, position, velocity, at target.
pub(super) fn motors_of(bulk: &Bulk, motors: &[u8]) -> impl Iterator<Item = (u8, i32, i16, bool)> {
    let Bulk { encoders, velocities, at_target, .. } = *bulk;
    let all = (0..).zip(encoders).zip(velocities).zip(at_target);
    all.filter(|(((motor, _), _), _)| motors.contains(motor)).map(|(((m, p), v), t)| (m, p, v, t))
}

/// The motor alerts in words.
pub(super) fn alert_words(status: Status) -> Vec<String> {
    status.alerts().iter().map(MotorAlert::to_string).collect()
}

/// A place on standard output.
pub(crate) struct Live {
    pub(crate) terminal: bool,
    /// Lines of the text that stands there.
    height: usize,
}

impl Live {
    pub(crate) fn new() -> Self {
        Self { terminal: std::io::stdout().is_terminal(), height: 0 }
    }

    /// Replaces what stands there.
    pub(crate) fn redraw(&mut self, text: &str) -> Result<(), Failure> {
        // Up to its first line, and clear to the end of the screen.
        let back = if self.height == 0 { String::new() } else { format!("\x1b[{}A\x1b[J", self.height) };
        self.height = text.lines().count();
        // Meanwhile long lines are cut off: wrapped ones would not be counted.
        print(&format!("{back}\x1b[?7l{text}\x1b[?7h"))
    }
}

/// Takes a reading at once and then every `interval`, until `each` says true, which ends in `Ok(true)`,
/// or `length` is over: `Ok(false)`.
pub(crate) fn repeat(
    session: &mut Session<Line>,
    interval: Duration,
    length: Option<Duration>,
    mut each: impl FnMut(&mut Session<Line>, &Reading) -> Result<bool, Trouble>,
) -> Result<bool, Trouble> {
    let since = Instant::now();
    let mut next = since;
    loop {
        let reading = Reading::take(session, since)?;
        if each(session, &reading)? {
            return Ok(true);
        }
        let now = Instant::now();
        // A reading that took too long does not make the next ones hurry.
        next = now.max(next + interval);
        let end = length.map(|length| since + length);
        let until = end.map_or(next, |end| end.min(next));
        interrupt::wait(until)?;
        if end.is_some_and(|end| end <= Instant::now()) {
            return Ok(false);
        }
    }
}
