//! Repeated readings of a hub. A terminal shows a table that is redrawn; other outputs get one line for a reading.

use super::interrupt;
use super::shaft_speed::shaft_speed;
use crate::output::{Failure, check_reader, print};
use motor_hub::extension::report::{HubReport, MotorReport};
use motor_hub::protocol::CHANNELS;
use motor_hub::protocol::answers::{Bulk, Status};
use motor_hub::units::Millivolts;
use motor_hub_client::motor_values::MotorValues;
use motor_hub_client::reasons::why_still;
use motor_hub_client::{Error, Session};
use serde::Serialize;
use serde_json::{Value, json};
use std::io::IsTerminal;
use std::time::{Duration, Instant};
use studies::{table, with_fields};

/// State of a hub, read by several requests one after the other. Each request resets the hub's keep-alive.
pub(crate) struct Reading {
    pub(crate) at: Duration,
    /// Answer to the bulk request, with the positions and velocities of `report` if there is a report: all values that
    /// are shown of a motor are then of one control tick, except `within_tolerance`.
    pub(crate) bulk: Bulk,
    battery: Millivolts,
    pub(crate) status: Status,
    /// Report of all motors; `None` if the hub sends no reports.
    pub(crate) report: Option<HubReport>,
}

impl Reading {
    pub(crate) fn take(session: &mut Session, since: Instant) -> Result<Self, Error> {
        let (mut bulk, status) = (session.bulk()?, session.status(false)?);
        let report = session.report()?;
        let battery = match &report {
            Some(report) => {
                put_motion(report, &mut bulk);
                report.battery.unwrap_or_default()
            }
            None => session.battery()?,
        };
        Ok(Self { at: since.elapsed(), bulk, battery, status, report })
    }

    fn reported(&self, motor: u8) -> Option<&MotorReport> {
        self.report.as_ref()?.motors.get(usize::from(motor))
    }

    /// Returns the word for a motor at its target. Hubs that send no reports only say whether a motor is within
    /// tolerance.
    const fn settled_label(&self) -> &'static str {
        if self.report.is_some() { "settled" } else { "within tolerance" }
    }

    /// Returns why a motor does not turn; `None` if no reason is known.
    fn why(&self, motor: u8) -> Option<&'static str> {
        why_still(self.report.as_ref()?, motor.into())
    }

    fn battery_v(&self) -> Option<f64> {
        volts(self.battery)
    }

    /// Returns a table for a terminal. `counts_per_turn` is the number of counts in a turn of the output shaft; if it is given,
    /// the table also shows the speed of the shaft.
    pub(crate) fn table(&self, motors: &[u8], counts_per_turn: Option<f64>) -> String {
        let mut headings = vec!["motor", "position, counts", "velocity, counts/s", self.settled_label()];
        headings.extend(counts_per_turn.iter().flat_map(|_| ["rpm", "rad/s"]));
        headings.extend(
            self.report.iter().flat_map(|_| ["control, %", "bridge", "current, A", "why it does not turn"]),
        );
        let mut table = table::new(&headings, 0);
        for MotorReading { motor, position, velocity, within_tolerance } in motors_of(&self.bulk, motors) {
            let settled = self.reported(motor).map_or(within_tolerance, |of| of.settled);
            let settled = if settled { "yes" } else { "no" };
            let shaft = counts_per_turn.map(|counts_per_turn| shaft_speed(velocity, counts_per_turn));
            let shaft = shaft.into_iter().flat_map(|(rpm, rad)| [format!("{rpm:.1}"), format!("{rad:.2}")]);
            let row = [motor.to_string(), position.to_string(), velocity.to_string(), settled.into()];
            let more = self.reported(motor).map(MotorValues::of).map(|values| {
                let why = self.why(motor).unwrap_or_default().to_owned();
                let [control, current] = [100.0 * values.control, values.current_a];
                [format!("{control:.1}"), bridge(&values), format!("{current:.2}"), why]
            });
            table.add_row(row.into_iter().chain(shaft).chain(more.into_iter().flatten()));
        }
        let (seconds, battery) = (self.at.as_secs_f64(), volts_text(self.battery_v(), 2));
        format!("{seconds:.1} s, battery {battery}\n{}\n{table}\n", self.status_text())
    }

    /// Returns status and alerts as text.
    fn status_text(&self) -> String {
        let words = self.status.words().into_iter().map(str::to_owned);
        let words: Vec<String> = words.chain(alert_words(self.status)).collect();
        let attention = if self.bulk.attention == Some(true) { "attention: " } else { "status: " };
        attention.to_owned() + &if words.is_empty() { "no alerts".to_owned() } else { words.join(", ") }
    }

    /// Returns the reading as one line of text. The line says why a motor that has not settled does not turn.
    pub(crate) fn line(&self, motors: &[u8], counts_per_turn: Option<f64>) -> String {
        let motors = motors_of(&self.bulk, motors).map(|reading| {
            let MotorReading { motor, position, velocity, within_tolerance } = reading;
            let settled = self.reported(motor).map_or(within_tolerance, |of| of.settled);
            let state = if settled { Some(self.settled_label()) } else { self.why(motor) };
            let state = state.map(|state| format!(", {state}")).unwrap_or_default();
            let shaft = counts_per_turn.map(|counts_per_turn| shaft_speed(velocity, counts_per_turn));
            let rpm = shaft.map(|(rpm, rad)| format!(" ({rpm:.1} rpm, {rad:.2} rad/s)")).unwrap_or_default();
            let values = self.reported(motor).map(MotorValues::of);
            let current = values.map(|values| format!(", {:.2} A", values.current_a)).unwrap_or_default();
            format!("; motor {motor}: {position} counts, {velocity} counts/s{rpm}{current}{state}")
        });
        let motors: String = motors.collect();
        format!("{:.1} s, {}{motors}\n", self.at.as_secs_f64(), volts_text(self.battery_v(), 2))
    }

    /// Returns the reading as JSON in seconds, volts, counts and counts per second; with `counts_per_turn`, also the speed of the
    /// shaft.
    pub(crate) fn json(&self, motors: &[u8], counts_per_turn: Option<f64>) -> Value {
        let motors: Vec<Value> = motors_of(&self.bulk, motors)
            .map(|reading| {
                let mut document = json!(reading);
                if let Some(counts_per_turn) = counts_per_turn {
                    let (rpm, rad) = shaft_speed(reading.velocity, counts_per_turn);
                    document = with_fields(document, json!({ "rpm": rpm, "rad_per_s": rad }));
                }
                if let Some(report) = self.reported(reading.motor) {
                    let more = json!({
                        // This value in steps (-32767 to 32767) replaces the share of full control in [`MotorValues`].
                        "control": report.control.get(),
                        "enabled": report.enabled,
                        "why_still": self.why(reading.motor),
                    });
                    document = with_fields(with_fields(document, json!(MotorValues::of(report))), more);
                }
                document
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

/// Replaces positions and velocities of a bulk answer by those of a report.
pub(super) fn put_motion(report: &HubReport, bulk: &mut Bulk) {
    let values = bulk.encoders.iter_mut().zip(&mut bulk.velocities);
    for ((position, velocity), motor) in values.zip(&report.motors) {
        (*position, *velocity) = (motor.position, motor.velocity);
    }
}

/// Returns a battery voltage in volts; `None` if the hub does not know the voltage and sends 0.
pub(super) fn volts(battery: Millivolts) -> Option<f64> {
    (battery != Millivolts::default()).then(|| f64::from(battery.get()) / 1e3)
}

/// Returns a voltage as text.
pub(super) fn volts_text(volts: Option<f64>, decimals: usize) -> String {
    volts.map_or_else(|| "unknown".to_owned(), |volts| format!("{volts:.decimals$} V"))
}

/// Returns regime, mode and duty of the bridge as text.
fn bridge(values: &MotorValues) -> String {
    let Some((regime, mode)) = values.regime.zip(values.mode) else { return "open".to_owned() };
    format!("{regime} {mode} {:.0} %", 100.0 * values.duty)
}

/// One motor of a bulk answer. JSON documents have these fields.
#[derive(Serialize)]
pub(super) struct MotorReading {
    pub(super) motor: u8,
    /// Position in counts.
    pub(super) position: i32,
    /// Velocity in counts per second.
    pub(super) velocity: i16,
    pub(super) within_tolerance: bool,
}

/// Returns the readings of the given motors.
pub(super) fn motors_of(bulk: &Bulk, motors: &[u8]) -> impl Iterator<Item = MotorReading> {
    let Bulk { encoders, velocities, within_tolerance, .. } = *bulk;
    let all = (0..).zip(encoders).zip(velocities).zip(within_tolerance);
    let all = all.map(|(((motor, position), velocity), within_tolerance)| MotorReading {
        motor,
        position,
        velocity,
        within_tolerance,
    });
    all.filter(|reading| motors.contains(&reading.motor))
}

/// Returns the motor alerts as text.
pub(super) fn alert_words(status: Status) -> Vec<String> {
    let of_motor =
        |motor| status.alerts(motor).into_iter().map(move |alert| format!("motor {motor} {alert}"));
    (0..CHANNELS).flat_map(of_motor).collect()
}

/// Number of readings of which one is printed if standard output is not a terminal.
const READINGS_PER_LINE: u32 = 10;

/// A text on standard output that is redrawn in place. An output that is no terminal gets lines instead.
pub(crate) struct Live {
    pub(crate) terminal: bool,
    /// Number of lines of the text shown last.
    height: usize,
    /// Number of readings shown by [`show`](Self::show).
    readings: u32,
    /// Line of the last reading, if this line was not printed.
    unprinted_line: Option<String>,
}

impl Live {
    pub(crate) fn new() -> Self {
        let terminal = std::io::stdout().is_terminal();
        Self { terminal, height: 0, readings: 0, unprinted_line: None }
    }

    /// Shows a reading: a text on a terminal, else the line of every tenth reading.
    pub(crate) fn show(&mut self, text: impl FnOnce() -> String, line: &str) -> Result<(), Failure> {
        let is_printed = self.readings.is_multiple_of(READINGS_PER_LINE);
        self.readings = self.readings.wrapping_add(1);
        self.unprinted_line = None;
        if self.terminal {
            return self.redraw(&text());
        }
        if is_printed {
            return print(line);
        }
        self.unprinted_line = Some(line.to_owned());
        Ok(())
    }

    /// Prints the line of the last reading, if [`show`](Self::show) has not printed this line.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        self.unprinted_line.map_or(Ok(()), |line| print(&line))
    }

    /// Replaces the text shown last.
    pub(crate) fn redraw(&mut self, text: &str) -> Result<(), Failure> {
        print(&self.replacement(text))
    }

    /// Returns what a terminal gets to replace the text shown last. The terminal does not wrap lines of the text, because
    /// `height` would not count the wrapped lines. Standard output writes all up to the last line feed at once, so a
    /// signal does not leave a terminal that does not wrap lines.
    fn replacement(&mut self, text: &str) -> String {
        // Move the cursor to the first line of the old text, and clear to the end of the screen.
        let back = if self.height == 0 { String::new() } else { format!("\x1b[{}A\x1b[J", self.height) };
        self.height = text.lines().count();
        format!("{back}\x1b[?7l{}\x1b[?7h\r\n", text.trim_end_matches(['\r', '\n']))
    }
}

/// Calls `each` with the time of its first call, immediately and then every `interval`. Ends with `Ok(true)` when `each`
/// returns true, and with `Ok(false)` when `length` is over. Fails as soon as a signal has been received, and when the
/// reader of standard output has closed it.
pub(crate) fn repeat(
    interval: Duration,
    length: Option<Duration>,
    mut each: impl FnMut(Instant) -> Result<bool, Failure>,
) -> Result<bool, Failure> {
    let since = Instant::now();
    let end = length.map(|length| since + length);
    let mut next = since;
    while !each(since)? {
        // After a call that took longer than the interval the next call follows immediately. Missed calls are not made
        // up for.
        next = Instant::now().max(next + interval);
        interrupt::wait(end.map_or(next, |end| end.min(next)))?;
        check_reader()?;
        if end.is_some_and(|end| end <= Instant::now()) {
            return Ok(false);
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use motor_hub::protocol::Address;
    use motor_hub::units::CountsPerSecond;
    use motor_hub_client::memory::MemoryHub;
    use std::io::{Read, Result, Write};

    /// A hub whose motor 0 is 10 counts/s faster at each request.
    #[derive(Debug, Default)]
    struct AcceleratingHub {
        hub: MemoryHub,
        cps: i32,
    }

    impl Write for AcceleratingHub {
        fn write(&mut self, bytes: &[u8]) -> Result<usize> {
            self.cps += 10;
            self.hub.snapshot.motors[0].velocity = CountsPerSecond::new(self.cps);
            self.hub.write(bytes)
        }

        fn flush(&mut self) -> Result<()> {
            Ok(())
        }
    }

    impl Read for AcceleratingHub {
        fn read(&mut self, bytes: &mut [u8]) -> Result<usize> {
            self.hub.read(bytes)
        }
    }

    #[test]
    fn a_terminal_wraps_lines_again_before_the_last_line_feed() {
        let mut live = Live { terminal: true, ..Live::new() };
        assert_eq!(live.replacement("one\ntwo\n"), "\x1b[?7lone\ntwo\x1b[?7h\r\n");
        assert_eq!(live.replacement("three\r\n"), "\x1b[2A\x1b[J\x1b[?7lthree\x1b[?7h\r\n");
    }

    #[test]
    fn the_velocity_of_a_reading_is_of_the_same_tick_as_the_report() {
        let hub = AcceleratingHub::default();
        let mut session = Session::new(hub, Address::DEFAULT, Duration::from_secs(1));
        let reading = Reading::take(&mut session, Instant::now()).unwrap();
        let reported = reading.reported(0).unwrap().velocity;
        assert_eq!(reading.json(&[0], None)["motors"][0]["velocity"], reported);
    }
}
