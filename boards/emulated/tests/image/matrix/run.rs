//! Runs the rows of the fault matrix on a chip, one after another, and notes their results.

use std::time::Duration;

use emulated::host_link::{HostLink, Line};
use emulated::{Bench, Board, ChainBench, Lines, Transition};
use motor_hub::extension::report::BusReport;
use motor_hub::extension::report::Condition;
use motor_hub::extension::{HubFunction, MotorFunction, Request};
use motor_hub::protocol::Address;
use motor_hub::protocol::answers::Status;
use motor_hub::protocol::payload::Field;
use motor_hub::protocol::requests::{BATTERY, Standard, ToHub};
use motor_hub::store::Outcome;
use motor_hub::supply::BusState;

use super::modes::{MODES, Mode, Setup, powered};
use super::rows::{Recovery, Row};
use crate::chain::set_address;
use crate::common::{board, ms, other_board, time_to};
use crate::store;

/// Result of a row: what a fault has caused.
pub(crate) struct RowResult {
    /// What the other hub of a chain has done meanwhile.
    pub(crate) other: Option<OtherResult>,
    /// Reports of the hub itself, from its answers and its log.
    pub(crate) reports: Vec<&'static str>,
    /// Results of the motors, in the order of their modes.
    pub(crate) cells: Vec<MotorResult>,
}

/// What a fault has caused in one mode.
#[derive(Debug)]
pub(crate) struct MotorResult {
    /// Time from the fault until the bridge opened and stayed open. `None` if it was not open at the end of the fault.
    pub(crate) open_after: Option<Duration>,
    /// Time from the fault until the bridge shorted its motor and continued to short it. `None` if it did not short the
    /// motor at the end of the fault.
    pub(crate) shorted_after: Option<Duration>,
    /// Longest time for which the bridge was open during the fault.
    pub(crate) longest_open: Duration,
    /// Speed at the end of the fault, counts/s.
    pub(crate) speed: f64,
    /// Mean speed during the fault, counts/s.
    pub(crate) mean_speed: f64,
    /// Reports of this motor, from answers of the hub and its log.
    pub(crate) reports: Vec<&'static str>,
    /// How the motor followed its command again, or its speed in counts/s if it did not.
    pub(crate) back: Result<Recovery, f64>,
}

/// What the hub without a fault has done while the other hub of the chain had a fault.
#[derive(Debug)]
pub(crate) struct OtherResult {
    /// True if the parent had the fault, false if the child had the fault.
    pub(crate) fault_in_parent: bool,
    /// Longest time from the end of a request to the end of its answer.
    pub(crate) slowest: Duration,
    /// Number of requests without an answer.
    pub(crate) unanswered: usize,
    /// Modes whose motors have not followed their commands all the time.
    pub(crate) disturbed: Vec<Mode>,
}

/// Chips on which faults are applied one after another: one, or two in a chain. One of the two has all faults.
pub(crate) struct Run {
    pub(crate) chain: ChainBench,
    host: HostLink,
    setup: Setup,
    /// The hub that has the faults.
    faulty: Member,
    /// The hub without faults.
    other: Option<Member>,
    /// Times of the answers of the other hub to the requests of this row. `None` for a request without an answer.
    answers: Vec<Option<Duration>>,
}

/// A hub of a chain: its place on the line, and its address.
#[derive(Clone, Copy, Debug)]
struct Member {
    hub: usize,
    address: u8,
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
    (BusState::NoReading, "bus: silent"),
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
/// Longest time for which a bridge is open when the mode of its motor changes.
pub(crate) const MODE_CHANGE: Duration = ms(2);

/// Time between two requests to the other hub.
const REQUEST_INTERVAL: Duration = ms(100);

/// The address of a hub after its first start, and after each reset of the NUCLEO-F429ZI, which stores none.
const FIRST: u8 = Address::DEFAULT.get();
/// The address of the NUCLEO-H743ZI2 in a chain.
const SECOND: u8 = 9;

impl Run {
    /// Starts all motors of hubs on these boards, and waits until the motors follow their commands. Two hubs are a chain, the parent
    /// first. The board of the test gets the faults.
    pub(crate) fn new(setup: Setup, boards: &[Board]) -> Self {
        let mut host = HostLink::default();
        let mut chain = powered(boards);
        match boards {
            [Board::NucleoF429zi, _] => {
                // The parent changes its address first, and later back.
                for (from, to) in [(FIRST, 7), (FIRST, SECOND), (7, FIRST)] {
                    set_address(&mut chain, &mut host, from, to);
                }
            }
            [_, _] => set_address(&mut chain, &mut host, FIRST, SECOND),
            _ => {}
        }
        let member = |of: Board| {
            let hub = boards.iter().position(|board| *board == of)?;
            let is_second = boards.len() > 1 && of == Board::NucleoH743zi2;
            Some(Member { hub, address: if is_second { SECOND } else { FIRST } })
        };
        let (faulty, other) = (member(board()).expect("a hub with faults"), member(other_board()));
        for member in [Some(faulty), other].into_iter().flatten() {
            let host = host.to(member.address);
            MODES.iter().for_each(|mode| mode.start(setup, &mut chain, host));
        }
        let mut run = Self { chain, host, setup, faulty, other, answers: Vec::new() };
        run.settle();
        run
    }

    /// Begins the fault of a row, ends it, and waits until all motors follow their commands again.
    pub(crate) fn row(&mut self, row: &Row) -> RowResult {
        let _: Status = self.read(Standard::Status { clear: true });
        self.answers.clear();
        let (from, logged) = (self.now(), self.bench().log().len());
        let before = MODES.map(|mode| self.bench().look(mode.motor()));
        row.fault.set(self.bench(), true);
        row.fault.run(self);
        let (to, transitions) = (self.now(), self.bench().transitions());
        let after = MODES.map(|mode| self.bench().look(mode.motor()));
        let blind =
            row.fault.host_can_ask() && self.read::<i16>(ToHub::Adc { channel: BATTERY, raw: false }) == 0;
        let bus: Option<BusReport> = row.fault.host_can_ask().then(|| self.read(HubFunction::Bus));
        let log: Vec<String> = self.bench().log().into_iter().skip(logged).map(|line| line.text).collect();
        let stopped = off(self.bench());
        row.fault.set(self.bench(), false);
        self.pass(row.fault.until_answers());
        let status: Status = self.read(Standard::Status { clear: true });
        let mut reports: Vec<_> =
            status.words().iter().copied().chain(blind.then_some("battery reads 0 V")).collect();
        reports.extend(
            bus.and_then(|bus| BUS.into_iter().find(|(state, _)| *state == bus.state))
                .map(|(_, reports)| reports),
        );
        reports.extend(reported(&log, "", &OF_HUB));
        let said = MODES.map(|mode| self.said(mode, status, &log));
        let back = self.recover(stopped);
        let cells = MODES.into_iter().zip(before.iter().zip(&after)).zip(said).zip(back);
        let cells = cells.map(|(((mode, (before, after)), reports), back)| MotorResult {
            open_after: time_to(&transitions, mode.motor(), from, Lines::open),
            shorted_after: time_to(&transitions, mode.motor(), from, Lines::shorted),
            longest_open: longest_open(&transitions, mode.motor(), from, to),
            speed: after.counts_per_second,
            mean_speed: (after.counts - before.counts) as f64 / (to - from).as_secs_f64(),
            reports,
            back,
        });
        let cells = cells.collect();
        RowResult { other: self.other.map(|other| self.other_result(other, from)), reports, cells }
    }

    /// Returns what the other hub has done since the time `from`.
    fn other_result(&mut self, other: Member, from: Duration) -> OtherResult {
        let hub = &mut self.chain.hubs[other.hub];
        let (now, transitions) = (hub.now(), hub.transitions());
        let mut follows = |mode: &Mode| {
            longest_open(&transitions, mode.motor(), from, now) <= MODE_CHANGE
                && mode.speeds().contains(&hub.look(mode.motor()).counts_per_second)
        };
        OtherResult {
            fault_in_parent: self.faulty.hub == 0,
            slowest: self.answers.iter().flatten().copied().max().unwrap_or_default(),
            unanswered: self.answers.iter().filter(|answer| answer.is_none()).count(),
            disturbed: MODES.into_iter().filter(|mode| !follows(mode)).collect(),
        }
    }

    /// Returns the hub that has the faults.
    fn bench(&mut self) -> &mut Bench {
        &mut self.chain.hubs[self.faulty.hub]
    }

    pub(crate) fn now(&self) -> Duration {
        self.chain.now()
    }

    /// Runs for some time. In a chain the host sends requests to the other hub meanwhile.
    pub(crate) fn pass(&mut self, time: Duration) {
        let end = self.now() + time;
        while let Some(other) = self.other
            && self.now() < end
        {
            let answer = self.host.to(other.address).timed(&mut self.chain, Standard::KeepAlive);
            self.answers.push(answer.map(|(_, time)| time));
            self.chain.run(REQUEST_INTERVAL.min(end.saturating_sub(self.now())));
        }
        self.chain.run(end.saturating_sub(self.now()));
    }

    /// Asks the hub that has the faults.
    fn read<A: Field>(&mut self, request: impl Into<Request>) -> A {
        self.host.to(self.faulty.address).read(&mut self.chain, request)
    }

    /// Sends a keep-alive to the hub that has the faults.
    pub(crate) fn keep_alive(&mut self) {
        self.host.to(self.faulty.address).keep_alive(&mut self.chain);
    }

    /// Sends a keep-alive like [`keep_alive`](Self::keep_alive), but waits for no answer. Returns the number of answers that have
    /// arrived before. These answers are discarded.
    pub(crate) fn send_keep_alive(&mut self) -> usize {
        let answers = self.host.arrivals(self.chain.first()).len();
        self.host.to(self.faulty.address).send(&mut self.chain, Standard::KeepAlive);
        answers
    }

    /// Makes the hub that has the faults save its settings.
    pub(crate) fn save(&mut self) {
        let (report, _) = store::save(&mut self.chain, self.host.to(self.faulty.address));
        assert_eq!(report.outcome, Outcome::Done);
    }

    /// Returns the reports of one motor, from answers of the hub and its log.
    fn said(&mut self, mode: Mode, status: Status, log: &[String]) -> Vec<&'static str> {
        let mut reports: Vec<_> = status.alerts(mode.motor()).to_vec();
        let condition: Condition = self.read(MotorFunction::Condition.to(mode as u8));
        reports.extend(condition.bridge_fault.then_some("bridge off"));
        reports.extend(reported(log, &format!("motor {}: Faults", mode.motor()), &OF_MOTOR));
        reports
    }

    /// Ends the fault, and returns how each motor follows its command again. `stopped` are the motors that were not driven before.
    fn recover(&mut self, stopped: [bool; 4]) -> [Result<Recovery, f64>; 4] {
        self.keep_alive();
        self.pass(ms(300));
        let later = off(self.bench());
        self.start_again(self.faulty);
        self.other.into_iter().for_each(|other| self.start_again(other));
        self.settle();
        MODES.map(|mode| {
            let speed = self.bench().look(mode.motor()).counts_per_second;
            let recovery = match (stopped[mode.motor()], later[mode.motor()]) {
                (_, true) => Recovery::WhenEnabled,
                (true, false) => Recovery::ByItself,
                (false, false) => Recovery::WasDriven,
            };
            if mode.speeds().contains(&speed) { Ok(recovery) } else { Err(speed) }
        })
    }

    /// Starts the motors of a hub that are off, each in its mode.
    fn start_again(&mut self, member: Member) {
        let (off, host) = (off(&mut self.chain.hubs[member.hub]), self.host.to(member.address));
        for mode in MODES.into_iter().filter(|mode| off[mode.motor()]) {
            host.enable(&mut self.chain, mode as u8, false);
            mode.start(self.setup, &mut self.chain, host);
        }
    }

    /// Runs until all motors have followed their commands for 300 ms.
    fn settle(&mut self) {
        let (end, mut good) = (self.now() + BACK_WITHIN, 0);
        while good < 3 && self.now() < end {
            self.pass(ms(100));
            self.keep_alive();
            let all = self.chain.hubs.iter_mut().all(follows);
            good = if all { good + 1 } else { 0 };
        }
    }
}

/// True if all motors of a hub follow their commands.
fn follows(hub: &mut Bench) -> bool {
    MODES.into_iter().all(|mode| mode.speeds().contains(&hub.look(mode.motor()).counts_per_second))
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

/// Returns the names of the texts in `words` that a log line has. The line must begin with `of`.
fn reported(log: &[String], of: &str, words: &[(&str, &'static str)]) -> Vec<&'static str> {
    let tells = |word: &str| log.iter().any(|line| line.starts_with(of) && line.contains(word));
    words.iter().filter(|(word, _)| tells(word)).map(|(_, reports)| *reports).collect()
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
