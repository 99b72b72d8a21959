//! The test bench: an image on the emulated chip with motors, battery, serial line, log and faults round
//! it, advanced as a test says.

mod chain;
mod devices;
mod faults;
mod probe;

pub use chain::{ChainBench, LineFault};
pub use devices::ServoPulse;

use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, SyncSender, channel, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use defmt_decoder::Table;
use motor_hub::model::battery::Battery;
use motor_hub::model::si::{Ohms, Volts};
use rigless::emulator::{Host, Start};
use rigless::image::Image;
use rigless::session::Session;
use rigless::time::VirtualNanos;
use simulated::current_line::CurrentLine;

use crate::board::Board;
use crate::bridge_lines::{Lines, Transition};
use crate::chip::{FlashFaults, Nucleo, Pwm};
use crate::elf;
use crate::emulator_gaps;
use crate::faulty_code;
use crate::processor::{Code, Mpu};
use crate::pwm::Grid;
use crate::rtt::{self, LogLine};
use crate::shafts::{Look, Mounting, Shafts};
use crate::surroundings::{self, Order, Surroundings, terminal};
use crate::wiring;

/// What stands on the bench.
#[derive(Clone, Debug)]
pub struct Setup {
    /// Whose chip, and whose image.
    pub board: Board,
    /// One to four motors, by bridge.
    pub motors: Vec<Mounting>,
    /// Their battery.
    pub battery: Battery,
    /// The current-sense lines of their bridges, by motor.
    pub current_lines: Vec<CurrentLine>,
    /// Content of the memory for settings, [`Board::store`]. An empty one is blank.
    pub stored: Vec<u8>,
    /// The board's bootloader comes first, and starts the image that is built for it.
    pub bootloader: bool,
    /// File of the public key that the bootloader is built with, if it is to check signatures.
    pub bootloader_key: Option<PathBuf>,
    /// Content of the whole flash, [`Board::flash`], in place of images, as [`Bench::flash`] returns it. If it is
    /// empty, the flash holds the images.
    pub flash: Vec<u8>,
    /// What the interface of an STM32H743's flash does beyond its manual. The emulated F427 has no such faults.
    pub flash_faults: FlashFaults,
    /// A transceiver connects the chip to the line of a chain.
    pub transceiver: bool,
    /// How TIM1 is emulated.
    pub pwm: Pwm,
    /// How the memory protection unit is emulated.
    pub mpu: Mpu,
    /// Where to listen for GDB, if at all; the core then waits for it.
    pub gdb: Option<u16>,
}

impl Setup {
    /// These motors on the first board, with a 12 V battery of 50 mohm and sound current-sense lines.
    #[must_use]
    pub fn new(motors: Vec<Mounting>) -> Self {
        let battery = Battery { emf: Volts(12.0), resistance: Ohms(0.05) };
        Self {
            board: Board::default(),
            current_lines: vec![CurrentLine::Sound; motors.len()],
            motors,
            battery,
            stored: Vec::new(),
            bootloader: false,
            bootloader_key: None,
            flash: Vec::new(),
            flash_faults: FlashFaults::default(),
            transceiver: false,
            pwm: Pwm::default(),
            mpu: Mpu::default(),
            gdb: None,
        }
    }
}

/// One byte on the serial line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SerialByte {
    /// When its stop bit ended.
    pub at: Duration,
    /// The byte.
    pub byte: u8,
}

/// A restart of the chip.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reset {
    /// When.
    pub at: Duration,
    /// What caused it, as the emulator names it.
    pub cause: String,
}

/// Why the emulator's thread ended before its bench.
#[derive(Debug, thiserror::Error)]
enum Stopped {
    #[error(transparent)]
    Chip(#[from] rigless::soc::Error),
    #[error("no debugger can be listened to: {0}")]
    Debugger(#[from] std::io::Error),
    #[error(transparent)]
    Emulator(#[from] rigless::emulator::Error),
}

/// An image, running.
///
/// # Panics
/// Its methods panic when the emulator refuses to go on, with its reason.
pub struct Bench {
    orders: Sender<Order>,
    reached: Receiver<()>,
    thread: Option<JoinHandle<Result<(), Stopped>>>,
    table: Option<Table>,
    symbols: Vec<elf::Symbol>,
    board: Board,
    motors: usize,
    line: usize,
    heard: usize,
    now: u64,
}

impl Bench {
    /// The hub's firmware, just powered on.
    #[must_use]
    pub fn new(setup: Setup) -> Self {
        let image = if setup.bootloader { elf::hub_in_slot(setup.board) } else { elf::hub(setup.board) };
        Self::with_image(setup, &image)
    }

    /// Another image on the same board, just powered on.
    #[must_use]
    pub fn with_image(setup: Setup, image: &Path) -> Self {
        let bytes = std::fs::read(image).unwrap_or_else(|error| panic!("{}: {error}", image.display()));
        let table = Table::parse(&bytes).expect("the image's log strings are readable");
        let symbols = elf::symbols(&bytes);
        let log_ring = elf::find(&symbols, "_SEGGER_RTT");
        let raw = |name: &str, bytes: &[u8], at| {
            Image::new(Path::new(name), bytes.to_vec(), Some(at)).expect("an image")
        };
        let mut images = vec![Nucleo::factory_image(setup.board).expect("factory words")];
        if setup.flash.is_empty() {
            let divides_by_zero = elf::find(&symbols, "panic_const_div_by_zero").unwrap_or_default();
            images.push(faulty_code::image(divides_by_zero).expect("an image"));
            images.push(Image::new(image, bytes, None).expect("an image"));
            if setup.bootloader {
                let place = elf::bootloader(setup.board, setup.bootloader_key.as_deref());
                let bytes =
                    std::fs::read(&place).unwrap_or_else(|error| panic!("{}: {error}", place.display()));
                images.push(Image::new(&place, bytes, None).expect("an image"));
            }
            if !setup.stored.is_empty() {
                images.push(raw("settings", &setup.stored, setup.board.store().start));
            }
        } else {
            images.push(raw("flash", &setup.flash, setup.board.flash().start));
        }
        let (orders, order_queue) = channel();
        let (reached_sender, reached) = sync_channel(0);
        let (board, motors) = (setup.board, setup.motors.len());
        assert!(motors <= wiring::BRIDGES, "the board has {} bridges", wiring::BRIDGES);
        let thread = std::thread::spawn(move || run(setup, &images, log_ring, order_queue, reached_sender));
        let mut bench = Self {
            orders,
            reached,
            thread: Some(thread),
            table,
            symbols,
            board,
            motors,
            line: 0,
            heard: 0,
            now: 0,
        };
        bench.wait();
        bench
    }

    fn wait(&mut self) {
        if self.reached.recv().is_err() {
            self.fail();
        }
    }

    fn fail(&mut self) -> ! {
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(Err(reason))) => panic!("the emulator stopped: {reason}"),
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            _ => panic!("the emulator stopped"),
        }
    }

    /// Does something at the present instant.
    fn at_stop<T: Send + 'static>(
        &mut self,
        errand: impl FnOnce(&mut Surroundings, &mut Session<Nucleo>, &mut dyn Host) -> T + Send + 'static,
    ) -> T {
        let (answer, receiver) = sync_channel(1);
        let order = Order::Do(Box::new(move |surroundings, session, host| {
            // The answer has no receiver when the bench is being dropped.
            let _ = answer.send(errand(surroundings, session, host));
        }));
        if self.orders.send(order).is_err() {
            self.fail();
        }
        match receiver.recv() {
            Ok(answer) => answer,
            Err(_) => self.fail(),
        }
    }

    /// Does something at an instant to come.
    fn at(
        &mut self,
        at: Duration,
        errand: impl FnOnce(&mut Surroundings, &mut Session<Nucleo>, &mut dyn Host) + Send + 'static,
    ) {
        let at = nanos(at);
        self.at_stop(move |surroundings, _, _| surroundings.plan(at, Box::new(errand)));
    }

    /// Runs for some virtual time.
    pub fn run(&mut self, time: Duration) {
        self.run_until(Duration::from_nanos(self.now) + time);
    }

    /// Runs until this much virtual time has passed since power-on.
    pub fn run_until(&mut self, at: Duration) {
        let target = nanos(at);
        if target > self.now {
            self.begin_to_run(target);
            self.wait();
        }
    }

    /// Runs until this instant, ns, which is to come, beside its caller. [`wait`](Self::wait) waits for the end.
    fn begin_to_run(&mut self, target: u64) {
        if self.orders.send(Order::Run(target)).is_err() {
            self.fail();
        }
        self.now = target;
    }

    /// Runs in steps of `step` until `done` says so, at most for `limit`; true if it said so.
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

    /// Virtual time since power-on.
    #[must_use]
    pub const fn now(&self) -> Duration {
        Duration::from_nanos(self.now)
    }

    /// Number of motors.
    #[must_use]
    pub const fn motors(&self) -> usize {
        self.motors
    }

    /// Instructions that the core has executed; none while it sleeps.
    pub fn instructions(&mut self) -> u64 {
        self.at_stop(|surroundings, _, _| surroundings.instructions)
    }

    /// Where a shaft is and what flows.
    pub fn look(&mut self, motor: usize) -> Look {
        self.at_stop(move |surroundings, _, _| surroundings.shafts.look(motor, surroundings.now))
    }

    /// The lines of a bridge.
    pub fn lines(&mut self, motor: usize) -> Lines {
        self.at_stop(move |surroundings, _, _| surroundings.recorder.lines[motor])
    }

    /// The PWM periods, once the timer runs.
    pub fn pwm_grid(&mut self) -> Option<Grid> {
        self.at_stop(|surroundings, _, _| surroundings.grid())
    }

    /// Voltage of the battery under load, V, and current out of it, A.
    pub fn battery(&mut self) -> (f64, f64) {
        self.at_stop(|surroundings, _, _| {
            (surroundings.shafts.voltage(), surroundings.shafts.battery_current())
        })
    }

    /// Every change of any bridge's lines so far.
    pub fn transitions(&mut self) -> Vec<Transition> {
        self.at_stop(|surroundings, _, _| surroundings.recorder.transitions.clone())
    }

    /// The log so far.
    ///
    /// # Panics
    /// If the image has no log.
    pub fn log(&mut self) -> Vec<LogLine> {
        let taken = self.at_stop(|surroundings, _, _| surroundings.rtt.taken.clone());
        rtt::decode(self.table.as_ref().expect("the image logs"), &taken)
    }

    /// Presses or releases button B1.
    pub fn press(&mut self, pressed: bool) {
        self.at_stop(move |surroundings, session, _| surroundings.press(session, pressed));
    }

    /// From now on uses the host's line 0, of the ST-LINK, or 1, of a USB-serial adapter. What has come on it before is skipped.
    pub fn use_line(&mut self, line: usize) {
        self.line = line;
        self.heard = self.at_stop(move |_, session, _| terminal(session, line).incoming.len());
    }

    /// Sends bytes down the serial line, as fast as it takes them.
    pub fn send(&mut self, bytes: &[u8]) {
        let (bytes, line) = (bytes.to_vec(), self.line);
        self.at_stop(move |surroundings, session, _| {
            let now = surroundings.now;
            terminal(session, line).outgoing.extend(bytes.into_iter().map(|byte| (now, byte)));
        });
    }

    /// What came up the serial line since this was last asked.
    pub fn receive(&mut self) -> Vec<SerialByte> {
        let (heard, line) = (self.heard, self.line);
        let bytes = self.at_stop(move |_, session, _| {
            terminal(session, line).incoming.get(heard..).unwrap_or_default().to_vec()
        });
        self.heard += bytes.len();
        bytes.into_iter().map(|(at, byte)| SerialByte { at: Duration::from_nanos(at), byte }).collect()
    }

    /// The resets so far.
    pub fn resets(&mut self) -> Vec<Reset> {
        self.at_stop(|_, session, _| {
            let resets = session.resets().iter();
            resets
                .map(|reset| Reset {
                    at: Duration::from_nanos(reset.at.0),
                    cause: format!("{:?}", reset.cause),
                })
                .collect()
        })
    }

    /// What the emulator could not do as the chip would: empty, or the run proves nothing.
    pub fn gaps(&mut self) -> Vec<String> {
        self.at_stop(|_, session, _| emulator_gaps::gaps(session))
    }

    /// Asserts that nothing was silent: no gap of the emulator, no illegal way of a bridge, and the log
    /// begins within 2 us of power-on.
    ///
    /// # Panics
    /// If not so.
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
        let _ = self.orders.send(Order::End);
        if let Some(thread) = self.thread.take() {
            let result = thread.join();
            if !std::thread::panicking() {
                match result {
                    Ok(Ok(())) => {}
                    Ok(Err(reason)) => panic!("the emulator stopped: {reason}"),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
        }
    }
}

fn nanos(time: Duration) -> u64 {
    u64::try_from(time.as_nanos()).expect("a run shorter than 584 years")
}

/// The emulator's thread.
fn run(
    setup: Setup,
    images: &[Image],
    log_ring: Option<u64>,
    orders: Receiver<Order>,
    reached: SyncSender<()>,
) -> Result<(), Stopped> {
    // A bootloader puts other code into flash.
    let lasts = !setup.bootloader;
    let code = Code::new(setup.board, setup.mpu, images, lasts);
    let mut board = Nucleo::new(setup.board, setup.pwm, setup.flash_faults, code)?;
    board.chip.attach();
    surroundings::pull_up_buses(&mut board, VirtualNanos(0));
    let shafts = Shafts::new(setup.battery, setup.motors);
    let mut surroundings =
        Surroundings::new(setup.board, shafts, setup.current_lines, log_ring, (orders, reached));
    if setup.transceiver {
        surroundings.connect_transceiver(&mut board);
    }
    let session = Session::new(Box::new(board), 0, VirtualNanos(0))?;
    let listener = setup.gdb.map(|port| std::net::TcpListener::bind(("127.0.0.1", port))).transpose()?;
    let mut start = Start::new(images);
    start.debugger = listener.as_ref();
    start.wait_for_debugger = listener.is_some();
    rigless::emulator::run(session, &start, surroundings)?;
    Ok(())
}
