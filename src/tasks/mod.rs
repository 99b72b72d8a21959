//! The async tasks. Each task waits for an input, calls the [core](crate), and passes the result on.
//!
//! ```text
//! capture   --readings--> +---------+ --drives----> output
//! supply    --battery---> | control | --snapshot--> responder, telemetry
//! responder --commands--> +---------+
//! ```
//!
//! The channels between the tasks are the fields of [`Wires`]. Most of them hold the newest value, which the next value
//! overwrites.
//!
//! A [*direct* command](crate::hub::Command::is_direct) needs no regulator, so a motor can execute the command between
//! two ticks.
//!
//! Control locks the cell `newest` while it updates its estimates. With a mutex type `M` that masks interrupts,
//! interrupts wait during this time.
//!
//! All tasks are generic over the number of motors and over the board's traits. An embassy task cannot be generic, so a
//! board wraps each task in an embassy task of one line.
//!
//! ```
//! use embassy_sync::blocking_mutex::raw::NoopRawMutex;
//! use motor_hub::hub::Command;
//! use motor_hub::motor::Setpoint;
//! use motor_hub::tasks::Wires;
//! use motor_hub::units::Control;
//!
//! // The command waits for the control task. The example two_motors.rs runs all tasks.
//! let wires = Wires::<NoopRawMutex, 2>::new();
//! let command = Command::Set { motor: 0, setpoint: Setpoint::ConstantPower(Control::MAX) };
//! assert_eq!(wires.try_send(command), Ok(1), "the first command since boot");
//! assert_eq!(wires.next_command(), Some(command));
//! ```

pub mod bridges;
pub mod capture;
pub mod chain;
pub mod control;
pub mod health;
pub mod i2c;
pub mod output;
pub mod responder;
pub mod store;
pub mod supply;
pub mod update;

pub use health::{Health, Task};

use crate::bridge::{BridgeFeedback, Drive};
use crate::devices::{I2C_BUSES, I2cTransfer};
use crate::hub::{Command, GyroReading, Snapshot};
use crate::motion::Newest;
use crate::motor::Setpoint;
use crate::protocol::Packet;
use crate::protocol::answers::I2cRead;
use crate::record::{CrashReport, Fault, Record, SIZE};
use crate::store::{StoreRequest, StoreResult};
use crate::supply::{Battery, BusReading};
use crate::units::Micros;
use core::cell::{Cell, RefCell};
use core::future::{pending, poll_fn};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::blocking_mutex::{CriticalSectionMutex, Mutex};
use embassy_sync::channel::{Channel, TrySendError};
use embassy_sync::signal::Signal;
use embassy_sync::watch::Watch;
use embassy_time::{Instant, TICK_HZ, Timer};

/// Number of commands that can wait in the queue.
pub const COMMANDS: usize = 16;

/// Largest number of tasks that can wait for snapshots.
pub const OBSERVERS: usize = 4;

/// Longest word that a flash may have, in bytes.
const WORD_BYTES: usize = 32;

/// The signals between the responder and a task that carries out its requests.
pub struct RequestChannel<M: RawMutex, Request, Report> {
    /// Request of the responder. The responder waits for the result before it sends the next request.
    pub request: Signal<M, Request>,
    /// Result of the request, or another report of the task.
    pub done: Signal<M, Report>,
}

impl<M: RawMutex, Request, Report> RequestChannel<M, Request, Report> {
    /// Creates empty signals.
    const fn new() -> Self {
        Self { request: Signal::new(), done: Signal::new() }
    }
}

/// The channels between the tasks of a hub with N motors. A board has one static of this type.
pub struct Wires<M: RawMutex, const N: usize> {
    /// Wakes control: capture has taken an encoder sample, or supply has taken the first plausible sample after an
    /// alarm of the bus.
    pub control_wake: Signal<M, ()>,
    /// State of the battery, from supply to control. With a state older than 100 ms the battery counts as unknown.
    pub battery: Signal<M, Battery>,
    /// Last reading of the bus, from supply to all tasks. A reading older than 100 ms counts as no reading.
    pub bus: Mutex<M, Cell<BusReading>>,
    /// Queue of commands to motors, from all tasks to control, first in first out.
    commands: Channel<M, Command, COMMANDS>,
    /// Number of the newest command that has entered `commands`; 0 before the first command. The lock is held while a
    /// command enters, so that commands have their numbers in the order of the queue.
    newest_command: Mutex<M, Cell<u32>>,
    /// Set with each direct command: control must apply the waiting commands the next time that `control_wake` wakes
    /// control. A tick applies them too, but does not clear the flag.
    pub urgent: Mutex<M, Cell<bool>>,
    /// Commands to the bridges, from control to output. After three control periods without new commands all bridges
    /// coast.
    pub drives: Signal<M, [Drive; N]>,
    /// Feedback of the bridges, from the bridges' task to control.
    pub sensed: Signal<M, [BridgeFeedback; N]>,
    /// State of all motors at the last tick, from control to all tasks.
    pub snapshot: Watch<M, Snapshot<N>, OBSERVERS>,
    /// Positions at the newest encoder samples, from capture to all tasks. Control adds the speeds, unless its period
    /// is 1 ms. A motor whose reading is older than 20 ms counts as a motor without encoder.
    pub newest: Mutex<M, RefCell<Newest<N>>>,
    /// Record of faults. Control writes the record, and the responder reads and clears the record. `None` if the hub
    /// has no record.
    pub record: Mutex<M, RefCell<Option<Record<'static>>>>,
    /// Memory for the fault that ends this run, from a fault handler to the next run. `None` if the hub has no record.
    pub crash_report: CriticalSectionMutex<RefCell<Option<CrashReport<'static>>>>,
    /// Requests of the responder to the task that stores settings, and their results.
    pub store: RequestChannel<M, StoreRequest, StoreResult>,
    /// Requests of the responder to the task that writes new firmware, and their results.
    pub update: RequestChannel<M, crate::update::UpdateRequest, crate::update::SlotReport>,
    /// Transfers of the responder to the task of each I2C bus, and their results.
    pub i2c: [RequestChannel<M, I2cTransfer, I2cRead>; I2C_BUSES],
    /// Newest angle of the gyro, from the task of its bus to control. `None` without a gyro that works. Without a new
    /// angle for 100 ms the gyro counts as lost.
    pub gyro: Mutex<M, Cell<Option<GyroReading>>>,
    /// True while a drive base uses the gyro, from control to the task of the gyro's bus.
    pub gyro_wanted: Mutex<M, Cell<bool>>,
    /// Packets that have arrived on the chain line, to the responder: answers to the host, and requests to this hub. A
    /// packet that finds the queue full is dropped, and its sender repeats the packet.
    pub chain_received: Channel<M, Packet, 4>,
    /// Packets of the responder to the chain line: a request of this hub to a child, and an answer of this hub to its
    /// parent. A packet that finds the queue full is dropped, and its sender repeats the packet.
    pub chain_send: Channel<M, Packet, 2>,
    /// Set when the last byte of a packet has been sent on the chain line.
    pub chain_sent: Signal<M, ()>,
    /// Set when bytes or an error of the chain line arrive. Cleared when the bytes complete a packet.
    pub chain_bytes: Signal<M, ()>,
    /// True while the button may drive motors, from the responder to the button's task: after the stored settings are
    /// restored, until the first packet for this hub.
    pub button_permitted: Mutex<M, Cell<bool>>,
    /// Set-point that the button has sent last.
    button_setpoint: Mutex<M, Cell<Setpoint>>,
}

impl<M: RawMutex, const N: usize> Wires<M, N> {
    /// Creates empty channels.
    pub const fn new() -> Self {
        Self {
            control_wake: Signal::new(),
            battery: Signal::new(),
            bus: Mutex::new(Cell::new(BusReading::INITIAL)),
            commands: Channel::new(),
            newest_command: Mutex::new(Cell::new(0)),
            urgent: Mutex::new(Cell::new(false)),
            drives: Signal::new(),
            sensed: Signal::new(),
            snapshot: Watch::new(),
            newest: Mutex::new(RefCell::new(Newest::new())),
            record: Mutex::new(RefCell::new(None)),
            crash_report: CriticalSectionMutex::new(RefCell::new(None)),
            store: RequestChannel::new(),
            update: RequestChannel::new(),
            i2c: [const { RequestChannel::new() }; I2C_BUSES],
            gyro: Mutex::new(Cell::new(None)),
            gyro_wanted: Mutex::new(Cell::new(false)),
            chain_received: Channel::new(),
            chain_send: Channel::new(),
            chain_sent: Signal::new(),
            chain_bytes: Signal::new(),
            button_permitted: Mutex::new(Cell::new(false)),
            button_setpoint: Mutex::new(Cell::new(Setpoint::Disabled)),
        }
    }
}

impl<M: RawMutex, const N: usize> Wires<M, N> {
    /// Opens the record of faults in this memory. `cause` is the cause of the last reset.
    pub fn open_record(&self, memory: &'static mut [u8; SIZE], cause: Fault) {
        let (record, crash_report) = Record::open(memory, cause);
        self.record.lock(|slot| slot.replace(Some(record)));
        self.crash_report.lock(|slot| slot.replace(Some(crash_report)));
    }

    /// Stores the fault that ends the run, for the record. Does nothing on a hub without a record. May be called from
    /// any context. A fault that occurs during the call is not stored.
    pub fn report_crash(&self, fault: Fault, detail: [u32; 2]) {
        self.crash_report.lock(|slot| {
            if let Ok(mut slot) = slot.try_borrow_mut()
                && let Some(crash_report) = slot.as_mut()
            {
                crash_report.store(fault, detail);
            }
        });
    }

    /// Sends a command to the control task, and returns the command's number. [`Snapshot::includes`] says whether a
    /// snapshot includes the command with this number.
    ///
    /// The first command since boot has the number 1. Numbers wrap from 2^32 - 1 to 0. [`Hub`](crate::hub::Hub) counts
    /// the commands that it applies, so all commands to the hub must be sent by this method or by [`send`](Self::send).
    ///
    /// Control applies the command at the next tick. A direct command is applied earlier, at the next encoder sample,
    /// and so are all commands that wait at that time.
    ///
    /// # Errors
    /// Returns the command if [`COMMANDS`] commands wait already.
    pub fn try_send(&self, command: Command) -> Result<u32, TrySendError<Command>> {
        let number = self.newest_command.lock(|newest| {
            self.commands.try_send(command)?;
            newest.set(newest.get().wrapping_add(1));
            Ok(newest.get())
        })?;
        if command.is_direct() {
            self.urgent.lock(|urgent| urgent.set(true));
        }
        Ok(number)
    }

    /// Sends a command like [`try_send`](Self::try_send), but waits while the queue is full. If the future is dropped
    /// before it is ready, the command is not sent.
    pub async fn send(&self, command: Command) -> u32 {
        loop {
            if let Ok(number) = self.try_send(command) {
                return number;
            }
            poll_fn(|context| self.commands.poll_ready_to_send(context)).await;
        }
    }

    /// Sends the set-point of the button to all motors, unless the button has sent this set-point last. Returns false,
    /// and sends nothing, if the queue has too little room. The caller must then try again.
    pub fn try_send_by_button(&self, setpoint: Setpoint) -> bool {
        if self.button_setpoint.lock(Cell::get) == setpoint {
            return true;
        }
        if self.commands.free_capacity() < N {
            return false;
        }
        self.button_setpoint.lock(|sent| sent.set(setpoint));
        (0..N).all(|motor| self.try_send(Command::Set { motor, setpoint }).is_ok())
    }

    /// Takes the oldest waiting command out of the queue. `None` if no command waits.
    pub fn next_command(&self) -> Option<Command> {
        self.commands.try_receive().ok()
    }

    /// Calls `access` with the newest encoder samples.
    fn update_newest(&self, access: impl FnOnce(&mut Newest<N>)) {
        self.newest.lock(|newest| {
            // No task keeps the borrow across an await, so the borrow succeeds.
            if let Ok(mut newest) = newest.try_borrow_mut() {
                access(&mut newest);
            }
        });
    }
}

impl<M: RawMutex, const N: usize> Default for Wires<M, N> {
    fn default() -> Self {
        Self::new()
    }
}

/// Converts a time of the time driver to the core's time, in microseconds since boot.
fn micros(instant: Instant) -> Micros {
    Micros::new(instant.as_micros())
}

/// Rounds a time up to a whole millisecond. Capture and control both wait for whole milliseconds, so that they are due
/// together.
fn whole_millisecond(now: Instant) -> Instant {
    Instant::from_millis(now.as_micros().div_ceil(1000))
}

/// Converts a time of the core to the first tick of the time driver that is not before `at`.
fn instant(at: Micros) -> Instant {
    let ticks = u128::from(at.get()) * u128::from(TICK_HZ);
    Instant::from_ticks(u64::try_from(ticks.div_ceil(1_000_000)).unwrap_or(u64::MAX))
}

/// Waits until a time of the core, without end for `None`.
async fn until(deadline: Option<Micros>) {
    match deadline {
        Some(deadline) => Timer::at(instant(deadline)).await,
        None => pending().await,
    }
}
