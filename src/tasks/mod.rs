//! The async tasks: each waits, calls the core, and passes the result on.
//!
//! ```text
//! capture --readings--> +---------+ --drives--> output
//! supply  --battery---> | control | --snapshot-> whoever wants to see
//! anyone  --commands--> +---------+
//! ```
//!
//! | channel | kind | when full, or when nothing new comes |
//! |---|---|---|
//! | newest | the latest readings, in a cell | overwritten; one over 20 ms old counts as no encoder. A mutex that masks interrupts does so while the observers take it |
//! | news | [`Signal`] | set with each of them, and with a sample of a bus that has just left its quiet voltages: it waits for no other |
//! | battery | [`Signal`]: the latest | overwritten; over 100 ms old counts as no battery |
//! | bus | what was seen of it last, in a cell | overwritten; over 100 ms old it counts as nothing |
//! | commands | [`Commands`], a queue of 16: none is lost, in order and numbered | the sender waits, or gets its command back |
//! | urgent | a flag | set with a command that can be done at once: all that wait are taken within a millisecond |
//! | drives | [`Signal`]: the latest | overwritten; none for three control periods and all bridges coast |
//! | sensed | [`Signal`]: the latest | of boards that hear their bridges; overwritten. The last one holds |
//! | snapshot | [`Watch`]: the latest, for several readers | overwritten; it carries tick number, time, and the number of the newest command that it includes |
//! | record | of what happened, in a cell | written with each tick; the oldest entry makes room |
//! | last words | likewise, for fault handlers | written once a run |
//! | store | two [`Signal`]s | an order at a time, and what became of it |
//! | update | two [`Signal`]s | an order at a time, and what became of it |
//! | host spoke | a flag | set by the responder's task once a host has spoken, until reset |
//!
//! All of them are generic over the number of motors and over the board's traits, so an embassy
//! task, which cannot be generic, is one line in a board.
//!
//! ```
//! use embassy_sync::blocking_mutex::raw::NoopRawMutex;
//! use motor_hub::hub::{Action, Command};
//! use motor_hub::motor::Setpoint;
//! use motor_hub::tasks::Wires;
//! use motor_hub::units::Control;
//!
//! // What anyone says waits for the next tick, unless it can be done at once. All of the tasks, run: examples/two_motors.rs.
//! let wires = Wires::<NoopRawMutex, 2>::new();
//! let command = Command { motor: 0, action: Action::Set(Setpoint::ConstantPower(Control::MAX)) };
//! assert_eq!(wires.try_send(command), Ok(1), "the first command since boot");
//! assert_eq!(wires.commands.try_receive(), Ok(command));
//! ```

pub mod bridges;
pub mod capture;
pub mod commands;
pub mod control;
pub mod health;
pub mod output;
pub mod responder;
pub mod store;
pub mod supply;
pub mod update;

pub use commands::Commands;
pub use health::{Health, Task};

use crate::bridge::{Drive, Sensed};
use crate::hub::{Command, Snapshot};
use crate::motion::Newest;
use crate::record::{Fault, LastWords, Record, SIZE};
use crate::supply::{Battery, Seen};
use crate::units::Micros;
use core::cell::{Cell, RefCell};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::blocking_mutex::{CriticalSectionMutex, Mutex};
use embassy_sync::channel::TrySendError;
use embassy_sync::signal::Signal;
use embassy_sync::watch::Watch;
use embassy_time::Instant;

/// Commands that may wait for the next tick.
pub const COMMANDS: usize = 16;

/// Receivers of snapshots.
pub const OBSERVERS: usize = 4;

/// Between the responder, which decides, and a task that does what takes time.
pub struct Errand<M: RawMutex, O, D> {
    /// What is to be done; one at a time.
    pub order: Signal<M, O>,
    /// What has been done.
    pub done: Signal<M, D>,
}

impl<M: RawMutex, O, D> Errand<M, O, D> {
    /// None.
    const fn new() -> Self {
        Self { order: Signal::new(), done: Signal::new() }
    }
}

/// The channels between the tasks of a hub with N motors: one static in a board.
pub struct Wires<M: RawMutex, const N: usize> {
    /// From capture, and of an alarm from supply, to control: there is something to look at.
    pub news: Signal<M, ()>,
    /// From supply to control.
    pub battery: Signal<M, Battery>,
    /// From supply to anyone: the bus as it was seen last.
    pub bus: Mutex<M, Cell<Seen>>,
    /// From anyone to control.
    pub commands: Commands<M>,
    /// From anyone to control: among the commands is one that waits for no tick, only for the next sample.
    pub urgent: Mutex<M, Cell<bool>>,
    /// From control to output.
    pub drives: Signal<M, [Drive; N]>,
    /// From the bridges' task to control.
    pub sensed: Signal<M, [Sensed; N]>,
    /// From control to anyone.
    pub snapshot: Watch<M, Snapshot<N>, OBSERVERS>,
    /// From capture to control and anyone: positions, as of the newest samples; speeds are from control.
    pub newest: Mutex<M, RefCell<Newest<N>>>,
    /// What happened, of control ticks and for the responder; `None` of a hub that keeps no record.
    pub record: Mutex<M, RefCell<Option<Record<'static>>>>,
    /// From whoever ends the run to the next one.
    pub last_words: CriticalSectionMutex<RefCell<Option<LastWords<'static>>>>,
    /// Between the responder and whoever has the memory for settings.
    pub store: Errand<M, crate::store::Order, store::Done>,
    /// Between the responder and whoever has the slot for new firmware.
    pub update: Errand<M, crate::update::Order, crate::update::Done>,
    /// From the responder to anyone: a host has spoken since reset.
    pub host_spoke: Mutex<M, Cell<bool>>,
}

impl<M: RawMutex, const N: usize> Wires<M, N> {
    /// Empty channels.
    pub const fn new() -> Self {
        Self {
            news: Signal::new(),
            battery: Signal::new(),
            bus: Mutex::new(Cell::new(Seen::NOTHING)),
            commands: Commands::new(),
            urgent: Mutex::new(Cell::new(false)),
            drives: Signal::new(),
            sensed: Signal::new(),
            snapshot: Watch::new(),
            newest: Mutex::new(RefCell::new(Newest::new())),
            record: Mutex::new(RefCell::new(None)),
            last_words: CriticalSectionMutex::new(RefCell::new(None)),
            store: Errand::new(),
            update: Errand::new(),
            host_spoke: Mutex::new(Cell::new(false)),
        }
    }
}

impl<M: RawMutex, const N: usize> Wires<M, N> {
    /// Begins a run with a record in this memory; `cause` is of the reset that it began with.
    pub fn remember(&self, memory: &'static mut [u8; SIZE], cause: Fault) {
        let (record, last_words) = Record::open(memory, cause);
        self.record.lock(|place| place.replace(Some(record)));
        self.last_words.lock(|place| place.replace(Some(last_words)));
    }

    /// Says what ends the run, from any context. What fails while it is being said is not.
    pub fn say_last(&self, fault: Fault, detail: [u32; 2]) {
        self.last_words.lock(|place| {
            if let Ok(mut place) = place.try_borrow_mut()
                && let Some(last_words) = place.as_mut()
            {
                last_words.say(fault, detail);
            }
        });
    }

    /// Sends a command to the control task, and returns the command's number. A command that needs no regulator is applied
    /// within a millisecond, any other one at the next tick. [`Snapshot::includes`] says whether a snapshot includes it.
    ///
    /// # Errors
    /// The command, if 16 wait already.
    pub fn try_send(&self, command: Command) -> Result<u32, TrySendError<Command>> {
        let number = self.commands.try_send(command)?;
        self.hurry(command);
        Ok(number)
    }

    /// Sends a command like [`try_send`](Self::try_send), but waits while there is no room.
    pub async fn send(&self, command: Command) -> u32 {
        let number = self.commands.send(command).await;
        self.hurry(command);
        number
    }

    fn hurry(&self, command: Command) {
        if command.action.is_direct() {
            self.urgent.lock(|urgent| urgent.set(true));
        }
    }
}

impl<M: RawMutex, const N: usize> Default for Wires<M, N> {
    fn default() -> Self {
        Self::new()
    }
}

/// The core's time is microseconds since boot, whatever the time driver's tick is.
fn micros(instant: Instant) -> Micros {
    Micros::new(instant.as_micros())
}

/// The next whole millisecond, so that tasks with periods of such meet.
fn whole_millisecond(now: Instant) -> Instant {
    Instant::from_millis(now.as_micros().div_ceil(1000))
}
