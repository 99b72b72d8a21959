//! One row after the other on a chip, and what is seen of it.

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

/// What came of a fault.
pub(crate) struct Seen {
    /// What host and log said of the hub.
    pub(crate) says: Vec<&'static str>,
    /// By mode.
    pub(crate) cells: Vec<SeenOne>,
}

/// What came of it in one mode.
#[derive(Debug)]
pub(crate) struct SeenOne {
    /// From the fault until the bridge was open for good, if it was when the fault was over.
    pub(crate) open_after: Option<Duration>,
    /// Time and speed of a bridge that shorted its motor.
    pub(crate) shorted_after: Option<Duration>,
    /// The longest that the bridge was open while the fault lasted.
    pub(crate) longest_open: Duration,
    /// Counts/s when the fault was over.
    pub(crate) speed: f64,
    /// What host and log said of this motor.
    pub(crate) says: Vec<&'static str>,
    /// Or the speed that it came back to instead.
    pub(crate) back: Result<Back, f64>,
}

/// A chip on which one fault follows the other.
pub(crate) struct Run {
    pub(crate) bench: Bench,
    host: HostLink,
    setup: Setup,
}

/// What the log tells of a motor, once a second.
const OF_MOTOR: [(&str, &str); 4] = [
    ("encoder: Some(Stuck)", "log: stuck"),
    ("encoder: Some(Reversed)", "log: reversed"),
    ("battery_unknown: true", "log: battery unknown"),
    ("encoder_stale: true", "log: encoder stale"),
];
/// What the hub tells of its bus, but for what is as it should be and what the status word has a word for.
const BUS: [(BusState, &str); 3] = [
    (BusState::Silent, "bus: silent"),
    (BusState::TooLow, "bus: too low"),
    (BusState::TooHigh, "bus: too high"),
];
/// And of the hub.
const OF_HUB: [(&str, &str); 4] = [
    ("supply fell", "log: supply fell"),
    ("started by the watchdog", "log: started by the watchdog"),
    ("HardFault", "log: HardFault"),
    ("malformed", "log: malformed"),
];
/// Longest time until motors follow their commands again. A load that ran away must be slowed down.
const BACK_WITHIN: Duration = ms(4_000);

impl Run {
    /// All motors follow their commands.
    pub(crate) fn new(setup: Setup) -> Self {
        let mut run = Self { bench: powered(), host: HostLink::default(), setup };
        MODES.iter().for_each(|mode| mode.start(setup, &mut run.bench, &mut run.host));
        run.settle();
        run
    }

    /// Puts a fault in, takes it out, and has all motors come back.
    pub(crate) fn row(&mut self, row: &Row) -> Seen {
        let Self { bench, host, .. } = self;
        let _: Status = host.question(bench, Standard::Status { clear: true });
        let (from, logged) = (bench.now(), bench.log().len());
        row.fault.put_in(bench);
        row.fault.lets_time_pass(bench, host);
        let (to, transitions) = (bench.now(), bench.transitions());
        let speeds = MODES.map(|mode| bench.look(mode.motor()).counts_per_second);
        let blind = row.fault.host_is_there()
            && host.question::<i16>(bench, ToHub::Adc { channel: BATTERY, raw: false }) == 0;
        let bus: Option<BusReport> =
            row.fault.host_is_there().then(|| host.question(bench, HubFunction::Bus));
        let log: Vec<String> = bench.log().into_iter().skip(logged).map(|line| line.text).collect();
        let away = off(bench);
        row.fault.take_out(bench);
        let status: Status = host.question(bench, Standard::Status { clear: true });
        let mut says: Vec<_> =
            status.words().iter().copied().chain(blind.then_some("battery reads 0 V")).collect();
        says.extend(
            bus.and_then(|bus| BUS.into_iter().find(|(state, _)| *state == bus.state)).map(|(_, says)| says),
        );
        says.extend(told(&log, "", &OF_HUB));
        let said = MODES.map(|mode| self.said(mode, status, &log));
        let back = self.come_back(away);
        let cells = MODES.into_iter().zip(speeds).zip(said).zip(back);
        let cells = cells.map(|(((mode, speed), says), back)| SeenOne {
            open_after: since(&transitions, mode.motor(), from, Lines::open),
            shorted_after: since(&transitions, mode.motor(), from, Lines::shorted),
            longest_open: longest_open(&transitions, mode.motor(), from, to),
            speed,
            says,
            back,
        });
        Seen { says, cells: cells.collect() }
    }

    /// What host and log say of one motor.
    fn said(&mut self, mode: Mode, status: Status, log: &[String]) -> Vec<&'static str> {
        let alerts = status.alerts().into_iter().filter(|alert| alert.motor == mode.motor());
        let mut says: Vec<_> = alerts.map(|alert| alert.text).collect();
        let condition: Condition =
            self.host.question(&mut self.bench, MotorFunction::Condition.to(mode as u8));
        says.extend(condition.bridge_fault.then_some("bridge off"));
        says.extend(told(log, &format!("motor {}: Faults", mode.motor()), &OF_MOTOR));
        says
    }

    /// Ends the fault, and returns how each motor follows its command again. `away` are the motors that had stopped.
    fn come_back(&mut self, away: [bool; 4]) -> [Result<Back, f64>; 4] {
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
            let way = match (away[mode.motor()], later[mode.motor()]) {
                (_, true) => Back::WhenEnabled,
                (true, false) => Back::ByItself,
                (false, false) => Back::WasNotAway,
            };
            if mode.speeds().contains(&speed) { Ok(way) } else { Err(speed) }
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

/// Open, or shorted for good, and not just for a tick or between two modes.
fn off(bench: &mut Bench) -> [bool; 4] {
    let (now, transitions) = (bench.now(), bench.transitions());
    MODES.map(|mode| {
        let lines = bench.lines(mode.motor());
        let last = transitions.iter().rfind(|t| t.motor == mode.motor());
        (lines.open() || lines.shorted()) && last.is_none_or(|last| now - last.at > ms(60))
    })
}

/// Since when a bridge has had such lines for good, after a fault; `None` if it has not now.
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

fn told(log: &[String], of: &str, words: &[(&str, &'static str)]) -> Vec<&'static str> {
    let tells = |word: &str| log.iter().any(|line| line.starts_with(of) && line.contains(word));
    words.iter().filter(|(word, _)| tells(word)).map(|(_, says)| *says).collect()
}

/// The longest time that a bridge is open between two instants.
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
    /// The host may ask something without changing what comes of the fault.
    const fn host_is_there(self) -> bool {
        !matches!(self, Self::HostSilent | Self::HostGarbled(_) | Self::SupplyFalls | Self::ClocksDoNotStart)
    }
}
