//! Runs the rows of the fault matrix on a chip, one after another, and notes their results.

use std::time::Duration;

use emulated::host_link::HostLink;
use emulated::{Bench, Lines, Transition};
use motor_hub::extension::report::BusReport;
use motor_hub::extension::report::Condition;
use motor_hub::extension::{HubFunction, MotorFunction};
use motor_hub::protocol::answers::Status;
use motor_hub::protocol::requests::{BATTERY, Standard, ToHub};
use motor_hub::supply::BusState;

use super::faults::Fault;
use super::modes::{MODES, Mode, Setup, powered};
use super::rows::{Back, Row};
use crate::common::ms;

/// Result of a row: what a fault has caused.
pub(crate) struct RowResult {
    /// Reports of the hub itself, from its answers and its log.
    pub(crate) says: Vec<&'static str>,
    /// Results of the motors, in the order of their modes.
    pub(crate) cells: Vec<MotorResult>,
}

/// What a fault has caused in one mode.
#[derive(Debug)]
pub(crate) struct MotorResult {
    /// Time from the fault until the bridge opened and stayed open. `None` if it was not open at the end of the fault.
    pub(crate) open_after: Option<Duration>,
    /// Time from the fault until the bridge shorted its motor and went on. `None` if it did not at the end of the fault.
    pub(crate) shorted_after: Option<Duration>,
    /// Longest time for which the bridge was open during the fault.
    pub(crate) longest_open: Duration,
    /// Speed at the end of the fault, counts/s.
    pub(crate) speed: f64,
    /// Reports of this motor, from answers of the hub and its log.
    pub(crate) says: Vec<&'static str>,
    /// How the motor followed its command again, or its speed in counts/s if it did not.
    pub(crate) back: Result<Back, f64>,
}

/// A chip on which faults are applied one after another.
pub(crate) struct Run {
    pub(crate) bench: Bench,
    host: HostLink,
    setup: Setup,
}

/// Texts of the log about a motor, and their names in the table. The log has them once a second.
const OF_MOTOR: [(&str, &str); 4] = [
    ("encoder: Some(Stuck)", "log: stuck"),
    ("encoder: Some(Reversed)", "log: reversed"),
    ("battery_unknown: true", "log: battery unknown"),
    ("encoder_stale: true", "log: encoder stale"),
];
/// States of the bus that count as reports, and their names in the table. Other states are normal, or are in the status word.
const BUS: [(BusState, &str); 3] = [
    (BusState::Silent, "bus: silent"),
    (BusState::TooLow, "bus: too low"),
    (BusState::TooHigh, "bus: too high"),
];
/// Texts of the log about the hub, and their names in the table.
const OF_HUB: [(&str, &str); 4] = [
    ("supply fell", "log: supply fell"),
    ("started by the watchdog", "log: started by the watchdog"),
    ("HardFault", "log: HardFault"),
    ("malformed", "log: malformed"),
];
/// Longest time until motors follow their commands again. A load that has accelerated a motor must first be slowed down.
const BACK_WITHIN: Duration = ms(4_000);

impl Run {
    /// Starts all motors, and waits until they follow their commands.
    pub(crate) fn new(setup: Setup) -> Self {
        let mut run = Self { bench: powered(), host: HostLink::default(), setup };
        MODES.iter().for_each(|mode| mode.start(setup, &mut run.bench, &mut run.host));
        run.settle();
        run
    }

    /// Applies the fault of a row, removes it, and waits until all motors follow their commands again.
    pub(crate) fn row(&mut self, row: &Row) -> RowResult {
        let Self { bench, host, .. } = self;
        let _: Status = host.question(bench, Standard::Status { clear: true });
        let (from, logged) = (bench.now(), bench.log().len());
        row.fault.apply(bench);
        row.fault.run(bench, host);
        let (to, transitions) = (bench.now(), bench.transitions());
        let speeds = MODES.map(|mode| bench.look(mode.motor()).counts_per_second);
        let blind = row.fault.host_can_ask()
            && host.question::<i16>(bench, ToHub::Adc { channel: BATTERY, raw: false }) == 0;
        let bus: Option<BusReport> = row.fault.host_can_ask().then(|| host.question(bench, HubFunction::Bus));
        let log: Vec<String> = bench.log().into_iter().skip(logged).map(|line| line.text).collect();
        let stopped = off(bench);
        row.fault.remove(bench);
        let status: Status = host.question(bench, Standard::Status { clear: true });
        let mut says: Vec<_> =
            status.words().iter().copied().chain(blind.then_some("battery reads 0 V")).collect();
        says.extend(
            bus.and_then(|bus| BUS.into_iter().find(|(state, _)| *state == bus.state)).map(|(_, says)| says),
        );
        says.extend(reported(&log, "", &OF_HUB));
        let said = MODES.map(|mode| self.said(mode, status, &log));
        let back = self.recover(stopped);
        let cells = MODES.into_iter().zip(speeds).zip(said).zip(back);
        let cells = cells.map(|(((mode, speed), says), back)| MotorResult {
            open_after: since(&transitions, mode.motor(), from, Lines::open),
            shorted_after: since(&transitions, mode.motor(), from, Lines::shorted),
            longest_open: longest_open(&transitions, mode.motor(), from, to),
            speed,
            says,
            back,
        });
        RowResult { says, cells: cells.collect() }
    }

    /// Returns the reports of one motor, from answers of the hub and its log.
    fn said(&mut self, mode: Mode, status: Status, log: &[String]) -> Vec<&'static str> {
        let alerts = status.alerts().into_iter().filter(|alert| alert.motor == mode.motor());
        let mut says: Vec<_> = alerts.map(|alert| alert.text).collect();
        let condition: Condition =
            self.host.question(&mut self.bench, MotorFunction::Condition.to(mode as u8));
        says.extend(condition.bridge_fault.then_some("bridge off"));
        says.extend(reported(log, &format!("motor {}: Faults", mode.motor()), &OF_MOTOR));
        says
    }

    /// Ends the fault, and returns how each motor follows its command again. `stopped` are the motors that were not driven before.
    fn recover(&mut self, stopped: [bool; 4]) -> [Result<Back, f64>; 4] {
        self.host.keep_alive(&mut self.bench);
        self.bench.run(ms(300));
        let later = off(&mut self.bench);
        for mode in MODES.into_iter().filter(|mode| later[mode.motor()]) {
            self.host.enable(&mut self.bench, mode as u8, false);
            mode.start(self.setup, &mut self.bench, &mut self.host);
        }
        self.settle();
        MODES.map(|mode| {
            let speed = self.bench.look(mode.motor()).counts_per_second;
            let recovery = match (stopped[mode.motor()], later[mode.motor()]) {
                (_, true) => Back::WhenEnabled,
                (true, false) => Back::ByItself,
                (false, false) => Back::WasDriven,
            };
            if mode.speeds().contains(&speed) { Ok(recovery) } else { Err(speed) }
        })
    }

    /// Runs until all motors have followed their commands for 300 ms.
    fn settle(&mut self) {
        let (host, mut good) = (&mut self.host, 0);
        self.bench.run_while(ms(100), BACK_WITHIN, |bench| {
            host.keep_alive(bench);
            let settled = |mode: Mode| mode.speeds().contains(&bench.look(mode.motor()).counts_per_second);
            good = if MODES.into_iter().all(settled) { good + 1 } else { 0 };
            good == 3
        });
    }
}

/// Returns for each motor whether its bridge has been open, or has shorted the motor, for more than 60 ms. A shorter time may
/// be a control tick or a change of the mode.
fn off(bench: &mut Bench) -> [bool; 4] {
    let (now, transitions) = (bench.now(), bench.transitions());
    MODES.map(|mode| {
        let lines = bench.lines(mode.motor());
        let last = transitions.iter().rfind(|t| t.motor == mode.motor());
        (lines.open() || lines.shorted()) && last.is_none_or(|last| now - last.at > ms(60))
    })
}

/// Returns the time from a fault until the lines of a bridge fulfilled `such` without interruption. `None` if they do not
/// fulfil `such` after the last transition.
fn since(
    transitions: &[Transition],
    motor: usize,
    fault: Duration,
    such: impl Fn(Lines) -> bool,
) -> Option<Duration> {
    let of_motor = transitions.iter().filter(|t| t.motor == motor);
    let at = of_motor.fold(None, |at: Option<Duration>, t| such(t.lines).then(|| at.unwrap_or(t.at)));
    at.map(|at| at.saturating_sub(fault))
}

/// Returns the names of the texts in `words` that a log line has. The line must begin with `of`.
fn reported(log: &[String], of: &str, words: &[(&str, &'static str)]) -> Vec<&'static str> {
    let tells = |word: &str| log.iter().any(|line| line.starts_with(of) && line.contains(word));
    words.iter().filter(|(word, _)| tells(word)).map(|(_, says)| *says).collect()
}

/// Returns the longest time for which a bridge was open between two times.
fn longest_open(transitions: &[Transition], motor: usize, from: Duration, to: Duration) -> Duration {
    let (mut longest, mut open) = (Duration::ZERO, None);
    for t in transitions.iter().filter(|t| t.motor == motor) {
        if let Some(since) = open.take() {
            longest = longest.max(t.at.saturating_sub(from.max(since)));
        }
        open = t.lines.open().then_some(t.at);
    }
    longest.max(open.map_or(Duration::ZERO, |since: Duration| to - from.max(since)))
}

impl Fault {
    /// True if a request of the host does not change the effects of the fault.
    const fn host_can_ask(self) -> bool {
        !matches!(self, Self::HostSilent | Self::HostGarbled(_) | Self::SupplyFalls | Self::ClocksDoNotStart)
    }
}
