//! The test bench: an image on the emulated chip, connected to motors, a battery, a serial line and a log. A test advances
//! the virtual time and injects faults.

mod chain;
mod devices;
mod faults;
mod probe;

pub use chain::{ChainBench, LineFault};

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use defmt_decoder::Table;
use motor_hub::model::battery::Battery;
use motor_hub::model::si::{Ohms, Volts};
use rigless::emulator::{Host, Start};
use rigless::image::Image;
use rigless::session::{Reset, Session};
use rigless::time::VirtualNanos;

use crate::board::Board;
use crate::bridge_lines::{Lines, Transition};
use crate::chip::Nucleo;
use crate::elf::{self, Variant};
use crate::faulty_code;
use crate::processor::Code;
use crate::pwm::Grid;
use crate::rtt::{self, LogLine};
use crate::serial::SerialByte;
use crate::shafts::{Look, Mounting, Shafts};
use crate::surroundings::{BenchTask, Surroundings, terminal};
use crate::wiring;

/// What a bench consists of.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The board, which decides the chip and the image.
    pub board: Board,
    /// Up to four motors, in the order of the bridges.
    pub motors: Vec<Mounting>,
    /// The battery of all motors.
    pub battery: Battery,
    /// Content of the memory for settings, [`Board::store`]. If it is empty, the memory is blank.
    pub stored: Vec<u8>,
    /// True if the board's bootloader runs first, and starts the image that is built for it.
    pub bootloader: bool,
    /// File of the public key that the bootloader is built with, if it is to check signatures.
    pub bootloader_key: Option<PathBuf>,
    /// Content of the whole flash, [`Board::flash`], in place of images, as [`Bench::flash`] returns it. If it is
    /// empty, the flash holds the images.
    pub flash: Vec<u8>,
    /// True if a transceiver connects the chip to the line of a chain.
    pub transceiver: bool,
    /// True if the emulator's own model of TIM1 is used, which has an event at every compare. Otherwise its registers alone are
    /// emulated, and the bench computes the waveforms from them. The firmware reads neither counter nor flags, so it finds no
    /// difference. This is several times faster.
    pub full_timer: bool,
    /// True if the whole memory protection unit is emulated. Otherwise its registers alone are emulated, and no memory is protected.
    /// Firmware that does not access protected memory finds no difference. This is several times faster.
    pub full_mpu: bool,
    /// TCP port for GDB. With a port the core waits until GDB has connected.
    pub gdb: Option<u16>,
}

impl Setup {
    /// Creates a bench of the default board with these motors, and a 12 V battery of 50 mohm.
    pub fn new(motors: Vec<Mounting>) -> Self {
        let battery = Battery { emf: Volts(12.0), resistance: Ohms(0.05) };
        Self {
            board: Board::default(),
            motors,
            battery,
            stored: Vec::new(),
            bootloader: false,
            bootloader_key: None,
            flash: Vec::new(),
            transceiver: false,
            full_timer: false,
            full_mpu: false,
            gdb: None,
        }
    }
}

/// Why the emulator's thread ended before the end of its bench.
type Stopped = Box<dyn std::error::Error + Send + Sync>;

/// A running image with its motors.
///
/// The emulator runs in a thread of its own, which carries out the bench's commands one after another. Hand-overs between the
/// two threads are slow. Therefore only a method with a result waits until its command has been carried out.
///
/// # Panics
/// All methods panic if the emulator has stopped; the message has the emulator's reason. They also panic if chip or image lack
/// what a test names: a register, a symbol, a task, a device.
pub struct Bench {
    commands: Sender<BenchTask>,
    thread: Option<JoinHandle<Result<(), Stopped>>>,
    table: Option<Table>,
    symbols: Vec<elf::Symbol>,
    board: Board,
    motors: usize,
    /// Line on which requests arrive: a line of the host, 0 or 1, or the chain line, 2.
    line: usize,
    /// Number of bytes on this line that the test has received.
    received: usize,
    /// Virtual time since power-on, ns.
    now: u64,
}

impl Bench {
    /// Powers on the hub's firmware.
    pub fn new(setup: Setup) -> Self {
        let image = if setup.bootloader {
            elf::build(setup.board.name(), Variant::InSlot)
        } else {
            elf::hub(setup.board)
        };
        Self::with_image(setup, &image)
    }

    /// Powers on another image on the board of `setup`.
    pub fn with_image(setup: Setup, image: &Path) -> Self {
        let bytes = std::fs::read(image).unwrap_or_else(|error| panic!("{}: {error}", image.display()));
        let table = Table::parse(&bytes).expect("the image's log strings are readable");
        let symbols = elf::symbols(&bytes);
        let log_ring = elf::find(&symbols, "_SEGGER_RTT");
        let raw = |name: &str, bytes: &[u8], at| {
            Image::new(Path::new(name), bytes.to_vec(), Some(at)).expect("an image")
        };
        let factory_words = Nucleo::factory_words(setup.board).iter();
        let mut images: Vec<_> =
            factory_words.map(|(at, word)| raw("factory word", &word.to_le_bytes(), *at)).collect();
        if setup.flash.is_empty() {
            let divides_by_zero = elf::find(&symbols, "panic_const_div_by_zero").unwrap_or_default();
            images.push(faulty_code::image(divides_by_zero).expect("an image"));
            images.push(Image::new(image, bytes, None).expect("an image"));
            if setup.bootloader {
                let package = setup.board.bootloader().expect("a board with a bootloader");
                let place = elf::build(
                    package,
                    setup.bootloader_key.as_deref().map_or(Variant::Usual, Variant::Signed),
                );
                images.push(Image::read(&place, None).expect("an image"));
            }
            if !setup.stored.is_empty() {
                images.push(raw("settings", &setup.stored, setup.board.store().start));
            }
        } else {
            images.push(raw("flash", &setup.flash, setup.board.flash().start));
        }
        let (commands, command_queue) = channel();
        let (board, motors) = (setup.board, setup.motors.len());
        assert!(motors <= wiring::BRIDGES, "the board has {} bridges", wiring::BRIDGES);
        let thread = std::thread::spawn(move || run(setup, &images, log_ring, command_queue));
        Self { commands, thread: Some(thread), table, symbols, board, motors, line: 0, received: 0, now: 0 }
    }

    /// Panics with the reason for which the emulator's thread has ended.
    fn fail(&mut self) -> ! {
        if let Some(thread) = self.thread.take() {
            join(thread);
        }
        panic!("the emulator stopped")
    }

    /// Runs a function on the emulator's thread at the present virtual time, and does not wait for its end. The channel
    /// will have the result.
    fn post<T: Send + 'static>(
        &mut self,
        task: impl FnOnce(&mut Surroundings, &mut Session<Nucleo>, &mut dyn Host) -> T + Send + 'static,
    ) -> Receiver<T> {
        let (result, receiver) = sync_channel(1);
        let command: BenchTask = Box::new(move |surroundings, session, host| {
            // The result has no receiver if nobody waits for it.
            let _ = result.send(task(surroundings, session, host));
        });
        if self.commands.send(command).is_err() {
            self.fail();
        }
        receiver
    }

    /// Waits for the result of [`post`](Self::post).
    fn wait<T>(&mut self, result: &Receiver<T>) -> T {
        result.recv().unwrap_or_else(|_| self.fail())
    }

    /// Runs a function on the emulator's thread at the present virtual time, and returns its result.
    fn at_stop<T: Send + 'static>(
        &mut self,
        task: impl FnOnce(&mut Surroundings, &mut Session<Nucleo>, &mut dyn Host) -> T + Send + 'static,
    ) -> T {
        let result = self.post(task);
        self.wait(&result)
    }

    /// Runs for some virtual time.
    pub fn run(&mut self, time: Duration) {
        self.run_until(Duration::from_nanos(self.now) + time);
    }

    /// Runs until this much virtual time has passed since power-on.
    pub fn run_until(&mut self, at: Duration) {
        let target = nanos(at);
        if target > self.now {
            self.post(move |surroundings, _, _| surroundings.target = target);
            self.now = target;
        }
    }

    /// Runs in steps of `step` until `done` returns true, at most for `limit`. Returns whether `done` has returned true.
    pub fn run_while(
        &mut self,
        step: Duration,
        limit: Duration,
        mut done: impl FnMut(&mut Self) -> bool,
    ) -> bool {
        let end = self.now() + limit;
        while self.now() < end {
            self.run(step);
            if done(self) {
                return true;
            }
        }
        false
    }

    /// Returns the virtual time since power-on.
    pub const fn now(&self) -> Duration {
        Duration::from_nanos(self.now)
    }

    /// Returns the number of motors.
    pub const fn motors(&self) -> usize {
        self.motors
    }

    /// Returns the number of instructions that the core has executed. A sleeping core executes none.
    pub fn instructions(&mut self) -> u64 {
        self.at_stop(|surroundings, _, _| surroundings.instructions)
    }

    /// Returns the motion and the current of a motor.
    pub fn look(&mut self, motor: usize) -> Look {
        self.at_stop(move |surroundings, _, _| surroundings.shafts.look(motor, surroundings.now))
    }

    /// Returns the lines of a bridge.
    pub fn lines(&mut self, motor: usize) -> Lines {
        self.at_stop(move |surroundings, _, _| surroundings.lines[motor])
    }

    /// Returns the PWM periods. `None` until the timer runs.
    pub fn pwm_grid(&mut self) -> Option<Grid> {
        self.at_stop(|surroundings, _, _| surroundings.timer.running)
    }

    /// Returns the voltage of the battery under load, V, and the current that leaves the battery, A.
    pub fn battery(&mut self) -> (f64, f64) {
        self.at_stop(|surroundings, _, _| (surroundings.shafts.voltage, surroundings.shafts.current))
    }

    /// Returns all changes of the lines of all bridges so far.
    pub fn transitions(&mut self) -> Vec<Transition> {
        self.at_stop(|surroundings, _, _| surroundings.transitions.clone())
    }

    /// Returns the log so far.
    pub fn log(&mut self) -> Vec<LogLine> {
        let taken = self.at_stop(|surroundings, _, _| surroundings.rtt.taken.clone());
        rtt::decode(self.table.as_ref().expect("the image logs"), &taken)
    }

    /// Presses or releases button B1. The board has a pull-down.
    pub fn press(&mut self, pressed: bool) {
        self.drive_pin(wiring::BUTTON, Some(pressed));
    }

    /// Puts a level on a pin, or releases the pin.
    fn drive_pin(&mut self, pin: (usize, u8), level: Option<bool>) {
        self.post(move |surroundings, session, _| {
            session.board_mut().drive_pin(surroundings.now, pin, level);
        });
    }

    /// Changes the line of the host to 0, of the ST-LINK, or 1, of a USB-serial adapter. Bytes that have arrived on this line before
    /// are skipped.
    pub fn use_line(&mut self, line: usize) {
        self.line = line;
        self.received = self.at_stop(move |_, session, _| terminal(session, line).incoming.len());
    }

    /// Sends bytes to the chip on the serial line, without pauses.
    pub fn send(&mut self, bytes: &[u8]) {
        let (bytes, line) = (bytes.to_vec(), self.line);
        self.post(move |_, session, _| terminal(session, line).outgoing.extend(bytes));
    }

    /// Returns the bytes that the chip has sent on the serial line since the last call.
    pub fn receive(&mut self) -> Vec<SerialByte> {
        let (received, line) = (self.received, self.line);
        let bytes = self.at_stop(move |_, session, _| {
            terminal(session, line).incoming.get(received..).unwrap_or_default().to_vec()
        });
        self.received += bytes.len();
        bytes
    }

    /// Returns all resets of the chip so far.
    pub fn resets(&mut self) -> Vec<Reset> {
        self.at_stop(|_, session, _| session.resets().to_vec())
    }

    /// Returns what the emulator could not do as the chip would. A run with such a gap proves nothing.
    pub fn gaps(&mut self) -> Vec<String> {
        self.at_stop(|_, session, _| {
            let mut gaps: Vec<String> = session.unmapped().iter().map(ToString::to_string).collect();
            gaps.extend(session.refused().iter().map(|(at, fault)| format!("refused {at:#x}: {fault}")));
            gaps.extend(
                session.unimplemented().iter().map(|(at, what)| format!("unimplemented {at:#x}: {what:?}")),
            );
            gaps.extend(session.undefined().iter().map(|(at, what)| format!("undefined {at:#x}: {what:?}")));
            gaps.extend(session.unrouted().iter().map(|what| format!("unrouted {what:?}")));
            gaps.extend(session.told().map(|told| format!("reported by a model {told:?}")));
            gaps
        })
    }

    /// Asserts that the emulator had no gap, that no transition of a bridge was illegal, and that the time stamp of the
    /// first log line is below 2 us.
    pub fn assert_sound(&mut self) {
        let gaps = self.gaps();
        assert!(gaps.is_empty(), "the emulator has gaps:\n{}", gaps.join("\n"));
        let illegal: Vec<String> =
            self.transitions().iter().filter(|t| !t.legal()).map(ToString::to_string).collect();
        assert!(illegal.is_empty(), "illegal transitions:\n{}", illegal.join("\n"));
        let first = self.log().into_iter().next().map(|line| line.stamp);
        let in_time = matches!(first.as_deref(), Some("0.000000" | "0.000001"));
        assert!(in_time, "the time driver started at the wrong time: {first:?}");
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        // Without the sender of its commands the emulator's thread ends.
        self.commands = channel().0;
        match self.thread.take() {
            Some(thread) if std::thread::panicking() => drop(thread.join()),
            Some(thread) => join(thread),
            None => {}
        }
    }
}

/// Waits for the end of the emulator's thread. Panics with the reason if the thread has stopped early.
fn join(thread: JoinHandle<Result<(), Stopped>>) {
    match thread.join() {
        Ok(Ok(())) => {}
        Ok(Err(reason)) => panic!("the emulator stopped: {reason}"),
        Err(panic) => std::panic::resume_unwind(panic),
    }
}

fn nanos(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).expect("a run shorter than 584 years")
}

/// Runs the emulator until the bench ends the run. This is the function of the emulator's thread.
fn run(
    setup: Setup,
    images: &[Image],
    log_ring: Option<u64>,
    commands: Receiver<BenchTask>,
) -> Result<(), Stopped> {
    // A bootloader writes other code into the flash.
    let is_constant = !setup.bootloader;
    let code = Code::new(setup.board, setup.full_mpu, images, is_constant);
    let mut board = Nucleo::new(setup.board, setup.full_timer, code)?;
    board.chip.attach();
    let shafts = Shafts::new(setup.battery, setup.motors);
    let mut surroundings = Surroundings::new(setup.board, shafts, log_ring, commands);
    if setup.transceiver {
        surroundings.transceiver = true;
        // An idle line is high.
        board.drive_pin(0, wiring::chain_input(setup.board), Some(true));
    }
    let session = Session::new(Box::new(board), 0, VirtualNanos(0))?;
    let listener = setup.gdb.map(|port| std::net::TcpListener::bind(("127.0.0.1", port))).transpose()?;
    let mut start = Start::new(images);
    start.debugger = listener.as_ref();
    start.wait_for_debugger = listener.is_some();
    rigless::emulator::run(session, &start, surroundings)?;
    Ok(())
}
