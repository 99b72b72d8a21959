//! A hub that host software can talk to, in real time: behind a serial line on this machine (a
//! pseudo-terminal) or a TCP port.
//!
//! The hub runs in steps of a millisecond of real time. Bytes are read in each step, so a reply leaves about a
//! millisecond after its request. A USB serial port is slower. In a step the hub receives at most the bytes that its
//! serial line carries ([`BYTES_A_STEP`]).
//!
//! ```no_run
//! use motor_hub::protocol::Address;
//! use simulated::scenario::Scenario;
//! use simulated::serve::{self, Hubs};
//!
//! // The hub is served until the process ends. `motor-hub client --tcp 127.0.0.1:7070 status` finds the hub.
//! let line = serve::tcp("127.0.0.1:7070")?;
//! let hubs = Hubs::chain(vec![Address::DEFAULT]);
//! serve::run(&Scenario::default_one()?, &hubs, line, None, &mut |_| (), &mut |_| true)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod chain_line;
pub mod interventions;
mod line;
mod memory;
#[cfg(unix)]
mod pty;
mod tcp;

pub use chain_line::{ChainLine, LineFault};
use interventions::Interventions;
pub use line::{Line, LineError, Wire, pty, tcp, within_process};
pub use memory::{Memory, MemoryError};

use crate::scenario::Scenario;
use crate::sim::{self, Executor, RunError, Wires};
use crate::world::Board;
use chain_line::ChainEnd;
use embassy_futures::join::join4;
use embassy_futures::{poll_once, yield_now};
use embassy_time::MockDriver;
use embedded_io_async::{ErrorType, Read, Write};
use motor_hub::bridge::Drive;
use motor_hub::hub::Snapshot;
use motor_hub::model::si::Seconds;
use motor_hub::protocol::{Address, BAUD, Colour};
use motor_hub::record::{Fault, SIZE};
use motor_hub::responder::Responder;
use motor_hub::tasks::{Health, Task, chain, responder, store};
use std::cell::{Cell, RefCell};
use std::convert::Infallible;
use std::future::{pending, poll_fn};
use std::pin::{Pin, pin};
use std::task::Poll;
use std::time::{Duration, Instant};

const STEP: Duration = Duration::from_millis(1);

/// Bytes that the serial line of a hub carries in a step; each takes ten bits.
pub const BYTES_A_STEP: usize = (BAUD / 10 / 1000) as usize;

/// Largest delay behind real time that is caught up. A longer delay is not caught up, because the hub would run many
/// steps at a time.
const LATE: Duration = Duration::from_millis(100);

/// Calls `step` once per millisecond of real time until it returns false. The arguments are the number of the step,
/// from 0, and the real time that was given up so far because steps took too long.
///
/// # Errors
/// Returns the errors of `step`.
pub fn pace<E>(mut step: impl FnMut(u64, Duration) -> Result<bool, E>) -> Result<(), E> {
    let mut due = Instant::now();
    let mut lost = Duration::ZERO;
    for number in 0.. {
        if !step(number, lost)? {
            break;
        }
        due += STEP;
        let now = Instant::now();
        if let Some(early) = due.checked_duration_since(now) {
            std::thread::sleep(early);
        } else if let Some(late) = now.checked_duration_since(due).filter(|&late| late > LATE) {
            lost += late;
            due = now;
        }
    }
    Ok(())
}

/// State of a served hub after a step.
pub struct Moment<'a> {
    /// Seconds since the start.
    pub at_s: f64,
    /// True if the hub has measured its battery, so that motors can be enabled.
    pub awake: bool,
    /// True if a host is on the line: see [`Line::is_taken`].
    pub taken: bool,
    /// Real time that was given up so far because this machine was too slow.
    pub lost: Duration,
    /// Number of hosts that were disconnected because another host was on the line.
    pub rejected_hosts: u32,
    /// Returns a line of text about the state of the hub.
    pub describe: &'a mut dyn FnMut() -> String,
}

/// Returns a line of text: the battery in volts, and the speed in counts/s and the bridge command of each motor.
pub fn line_on(battery_v: f64, motors: impl Iterator<Item = (f64, Drive)>) -> String {
    let motors = motors.map(|(cps, Drive { mode, duty })| {
        format!(" | {cps:.0} counts/s {} {:.0} %", mode.name(), 100.0 * duty.to_f64())
    });
    format!("{battery_v:.2} V{}", motors.collect::<String>())
}

/// The hubs to serve: one, or a chain of several. Each has the motors, the loads and the battery of the scenario.
#[derive(Clone, Debug)]
pub struct Hubs {
    /// The address of each hub. The first hub has the line to the host; the others are behind it.
    addresses: Vec<Address>,
    /// The chain line between the hubs.
    pub line: ChainLine,
}

impl Hubs {
    /// The hubs with these addresses, a chain if there are several. The first hub has the line to the host.
    pub fn chain(addresses: Vec<Address>) -> Self {
        let line = ChainLine::new(addresses.len());
        Self { addresses, line }
    }
}

/// Serves the hubs of a scenario with their motors, loads and batteries. The host gives the set-points. With a `memory`
/// the settings of the first hub outlast the program.
///
/// Every millisecond `intervene` is called, and may change the interventions in battery and motors of the first hub.
/// Then `show` is called. The hubs are served until `show` returns false.
///
/// # Errors
/// If a motor's constants do not fit the firmware, or if a hub's watchdog was not fed.
pub fn run(
    scenario: &Scenario,
    hubs: &Hubs,
    line: Box<dyn Line>,
    memory: Option<Memory>,
    intervene: &mut dyn FnMut(&mut Interventions),
    show: &mut dyn FnMut(Moment<'_>) -> bool,
) -> Result<(), RunError> {
    let so_far = Cell::new(Duration::ZERO);
    let mut show = |moment: Moment<'_>| show(Moment { lost: so_far.get(), ..moment });
    let mut served = pin!(steps(scenario, hubs, line, memory, intervene, &mut show));
    pace(|_, lost| {
        so_far.set(lost);
        match poll_once(served.as_mut()) {
            Poll::Pending => Ok(true),
            Poll::Ready(end) => end.map(|()| false),
        }
    })
}

/// What one served hub consists of, besides its tasks.
struct Served {
    board: Board,
    wires: Wires,
    health: Health,
    led: Cell<Colour>,
}

impl Served {
    fn new(scenario: &Scenario) -> Self {
        let (board, wires) = (Board::new(scenario), Wires::new());
        // The record lasts as long as the process, because a simulated hub is never reset.
        wires.open_record(Box::leak(Box::new([0; SIZE])), Fault::PowerOn);
        let health = Health::new().expecting(Task::Responder);
        Self { board, wires, health, led: Cell::default() }
    }

    fn tasks<'a>(
        &'a self,
        scenario: &Scenario,
        address: Address,
        host: End<'a>,
        chain_end: Option<ChainEnd>,
        memory: Option<Memory>,
    ) -> Result<Pin<Box<dyn Future<Output = ()> + 'a>>, RunError> {
        let settings = sim::all_settings(&scenario.motors)?;
        let tasks = sim::tasks(scenario, &self.board, &self.wires, &self.health)?;
        let mut hub = Responder::new(address, settings);
        if memory.is_some() {
            hub = hub.expecting_store();
        }
        if chain_end.is_some() {
            hub = hub.with_chain();
        }
        let serve = async move {
            let show = |colour| {
                self.led.set(colour);
                self.health.check_in(Task::Responder);
            };
            let mut pins = self.board.clone();
            responder::run(host, host, &mut pins, &mut hub, &self.wires, show).await;
        };
        let keep = async move {
            match memory.and_then(Memory::keeper) {
                Some(keeper) => store::run(keeper, &self.wires).await,
                None => pending().await,
            }
        };
        let chain = async move {
            match chain_end {
                Some(end) => chain::run(end.clone(), end, &self.wires).await,
                None => pending().await,
            }
        };
        Ok(Box::pin(async move {
            join4(tasks, serve, keep, chain).await;
        }))
    }
}

/// Serves hubs as [`run`], but each poll of the future is one millisecond, for callers with a clock of their own.
/// [`Moment::lost`] is 0.
///
/// # Errors
/// Returns the errors of [`run`].
pub async fn steps(
    scenario: &Scenario,
    hubs: &Hubs,
    line: Box<dyn Line>,
    mut memory: Option<Memory>,
    intervene: &mut dyn FnMut(&mut Interventions),
    show: &mut dyn FnMut(Moment<'_>) -> bool,
) -> Result<(), RunError> {
    MockDriver::get().reset();
    let (line, left) = (RefCell::new(line), Cell::new(0));
    let served: Vec<Served> = hubs.addresses.iter().map(|_| Served::new(scenario)).collect();
    let Some(parent) = served.first() else { return Ok(()) };
    let mut snapshots = parent.wires.snapshot.receiver().ok_or(RunError::Unobserved)?;
    let mut tasks = Vec::new();
    for (index, (hub, &address)) in served.iter().zip(&hubs.addresses).enumerate() {
        let host = End { line: (index == 0).then_some(&line), left: &left };
        let chain_end = (served.len() > 1).then(|| hubs.line.end(index));
        tasks.push((Executor::new(), hub.tasks(scenario, address, host, chain_end, memory.take())?));
    }

    let mut snapshot = Snapshot::INITIAL;
    let (mut interventions, mut begun_s) = (Interventions::default(), 0.0);
    let mut replaced = scenario.clone();
    for step in 0_u64.. {
        let at_s = step as f64 * sim::STEP_S;
        // Bytes may have arrived, and the lines have no waker. So all tasks are polled.
        left.set(BYTES_A_STEP);
        hubs.line.begin(step);
        loop {
            for (executor, tasks) in &mut tasks {
                executor.wake();
                executor.run(tasks.as_mut());
            }
            // What one hub has sent on the chain line reaches the others in the same millisecond.
            if !hubs.line.deliver() {
                break;
            }
        }
        let before = interventions;
        intervene(&mut interventions);
        if interventions != before {
            interventions.set_loads(&before, scenario, &parent.board);
            replaced = interventions.replace_in(scenario);
        }
        if interventions.restarts != before.restarts {
            begun_s = at_s;
            served.iter().for_each(|hub| hub.board.connect_as_at_start(scenario));
        }
        let scenario_s = at_s - begun_s;
        for (index, hub) in served.iter().enumerate() {
            let scenario = if index == 0 { &replaced } else { scenario };
            hub.board.change(scenario, scenario_s);
            hub.board.run(Seconds(sim::STEP_S), &sim::torques(scenario, scenario_s));
            if hub.board.starved() {
                return Err(RunError::Starved);
            }
        }
        MockDriver::get().advance(embassy_time::Duration::from_millis(1));
        snapshot = snapshots.try_changed().unwrap_or(snapshot);
        let describe = &mut || {
            let battery_v = snapshot.battery.map_or(0.0, |mv| f64::from(mv.get()) * 1e-3);
            let motors = snapshot.motors.iter().map(|motor| (motor.velocity.to_f64(), motor.drive));
            let Colour { red, green, blue } = parent.led.get();
            let servos = parent.board.servos().into_iter().enumerate();
            let servos =
                servos.filter_map(|(servo, pulse)| Some(format!(" | servo {servo} {} us", pulse?.width_us)));
            let servos: String = servos.collect();
            format!("LED #{red:02x}{green:02x}{blue:02x}, {}{servos}", line_on(battery_v, motors))
        };
        let (awake, rejected_hosts) = (snapshot.battery.is_some(), line.borrow().rejected_hosts());
        let taken = line.borrow().is_taken();
        let lost = Duration::ZERO;
        if !show(Moment { at_s, awake, taken, lost, rejected_hosts, describe }) {
            break;
        }
        yield_now().await;
    }
    Ok(())
}

/// A hub's end of the line to its host. It is polled every millisecond and needs no waker.
#[derive(Clone, Copy)]
struct End<'a> {
    /// `None` for a hub without a host.
    line: Option<&'a RefCell<Box<dyn Line>>>,
    /// Bytes that may still be received in this step. Without a limit, a host that never pauses would keep the step
    /// from ending.
    left: &'a Cell<usize>,
}

impl End<'_> {
    fn receive(&self, bytes: &mut [u8]) -> usize {
        let room = bytes.len().min(self.left.get());
        let received = match (self.line, bytes.get_mut(..room)) {
            (None, _) | (_, None | Some([])) => 0,
            (Some(line), Some(bytes)) => line.borrow_mut().receive(bytes),
        };
        self.left.set(self.left.get() - received);
        received
    }

    /// Sends bytes. Without a host all bytes are dropped.
    fn send(&self, bytes: &[u8]) -> usize {
        self.line.map_or(bytes.len(), |line| line.borrow_mut().send(bytes))
    }
}

impl ErrorType for End<'_> {
    type Error = Infallible;
}

impl Read for End<'_> {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        poll_fn(|_| ready(self.receive(bytes))).await
    }
}

impl Write for End<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        poll_fn(|_| ready(self.send(bytes))).await
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

const fn ready(bytes: usize) -> Poll<Result<usize, Infallible>> {
    if bytes == 0 { Poll::Pending } else { Poll::Ready(Ok(bytes)) }
}
