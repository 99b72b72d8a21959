//! The emulated chip of a board: its supply voltage, its calibration words, and models that replace or extend those of the
//! emulator. [`Part`] has what the bench needs of any chip. Each chip implements it in a module of its own.

/// Methods of [`Part`] whose text is the same for every chip, while their types differ. They use the chip's `self.part`,
/// `servos`, `buses` and `faults`, and `BOARD`.
macro_rules! same_on_every_chip {
    () => {
        fn drive_pin(&mut self, at: VirtualNanos, port: usize, pin: Pin, level: Option<Level>) {
            self.part.drive_port(at, port, |port, r, c| port.drive(pin, level, r, c));
        }

        fn pulse(&mut self, channel: Channel) -> Option<(u64, u64)> {
            let (timer, registers) = self.part.advanced_timer(0);
            timer.pulse(channel, registers).map(|pulse| (pulse.width.0, pulse.period.0))
        }

        fn servo(&self, servo: usize) -> &[ServoPulse] {
            &self.servos[servo].pulses
        }

        fn attach_device(&mut self, bus: usize, device: RegisterDevice) {
            self.buses[bus].controller.attach(device);
        }

        fn device(&mut self, bus: usize, nth: usize) -> Option<&mut RegisterDevice> {
            self.buses[bus].controller.chip_mut(nth)
        }

        fn hold_line(&mut self, at: VirtualNanos, bus: usize, line: usize, low: bool) {
            let lines = &mut self.buses[bus];
            let slot = self.part.bus().slot(lines.name).expect("a bus of the chip");
            let (registers, mut context) = self.part.bus_mut().drive(at, slot);
            lines.hold(line, low, registers, &mut context);
        }

        fn attach(&mut self) {
            for line in wiring::lines(BOARD) {
                self.part.usart[line].attach(Terminal::default());
            }
            for (port, pin) in wiring::BUSES.into_iter().take(self.buses.len()).flatten() {
                let pin = Pin::new(pin).expect("a pin of a port");
                self.drive_pin(VirtualNanos(0), port, pin, Some(Level::High));
            }
        }

        fn terminal(&mut self, line: usize) -> Option<&mut Terminal> {
            self.part.usart[wiring::lines(BOARD)[line]].chip_mut()
        }

        fn line_errors(&mut self, line: usize) -> &mut Errors {
            self.part.usart[wiring::lines(BOARD)[line]].errors_mut()
        }

        fn set_rail(&mut self, at: VirtualNanos, millivolts: u32) {
            self.part.set_supply(millivolts);
            self.follow_detector(at);
        }

        fn faults(&mut self) -> &mut ChipFaults {
            &mut self.faults
        }
    };
}

mod bus_lines;
mod converter;
mod f427;
mod flash_interface;
mod h743;
mod sampling_capacitor;
mod servo_timer;
mod watchdog;

use std::fmt::Debug;
use std::num::{NonZeroU32, NonZeroU64};

use rigless::chip::uart::Errors;
use rigless::cpu::armv7m::Window;
use rigless::device::{Device, Level};
use rigless::machine::armv7m::{Core, Variant};
use rigless::machine::{Board as Machine, Target};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::Store;
use rigless::soc::st::gpio::Pin;
use rigless::soc::st::tim::Channel;
use rigless::soc::{Error, Layout, RegisterSpec, Width};
use rigless::time::VirtualNanos;

use crate::board::Board;
use crate::processor::{self, Code};
use crate::pwm::Registers;
use crate::register_device::RegisterDevice;
use crate::serial::Terminal;
use crate::system_break::Connections;
use crate::wiring::{self, AnalogInput};
pub use flash_interface::FlashFaults;
pub(crate) use h743::Chip as H743;
pub use servo_timer::ServoPulse;

/// Supply voltage of the chip, mV.
const RAIL_MV: u32 = 3_300;

/// A register by its row in a table that its model has been given.
#[derive(Clone, Copy, Debug)]
struct Row(usize);

impl Layout for Row {
    const REGISTERS: &'static [RegisterSpec] = &[];

    fn from_index(index: usize) -> Option<Self> {
        Some(Self(index))
    }

    fn index(self) -> usize {
        self.0
    }
}

/// A peripheral that only stores what is written to its registers, which are in this table.
#[derive(Debug)]
struct StoredRegisters(&'static [RegisterSpec]);

impl StoredRegisters {
    /// Stands for the peripheral with these registers from now on.
    const fn of(&mut self, registers: &'static [RegisterSpec]) -> &mut Self {
        self.0 = registers;
        self
    }
}

impl Device for StoredRegisters {
    type Register = Row;

    fn layout(&self) -> &'static [RegisterSpec] {
        self.0
    }
}

/// Returns the content of a peripheral's register as a debugger reads it, which changes nothing.
fn peek(mcu: &mut (impl Mcu + ?Sized), address: u64) -> u32 {
    mcu.peek(VirtualNanos(0), address, Width::W32).expect("a register") as u32
}

/// Modes and output levels of the pins of a port.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Port {
    modes: u32,
    outputs: u32,
}

impl Port {
    fn read(mcu: &mut (impl Mcu + ?Sized), board: Board, port: usize) -> Self {
        let moder = wiring::port_at(board, port);
        Self { modes: peek(mcu, moder), outputs: peek(mcu, moder + wiring::ODR) }
    }

    const fn is_mode(self, pin: u8, mode: u32) -> bool {
        self.modes >> (2 * pin) & 3 == mode
    }

    /// Returns whether the pin is driven high. `None` if the pin is no output (RM0090 8.4.1, RM0433 11.4.1: mode 1 is an output).
    pub(crate) fn drives(self, pin: u8) -> Option<bool> {
        self.is_mode(pin, 1).then_some(self.outputs >> pin & 1 != 0)
    }

    /// Returns whether the pin is connected to a peripheral.
    pub(crate) const fn is_function(self, pin: u8) -> bool {
        self.is_mode(pin, 2)
    }
}

/// Faults that each chip can have. The default has none.
#[derive(Clone, Copy, Debug, Default)]
pub struct ChipFaults {
    /// True if the battery's converter accepts commands but converts nothing.
    pub converter_dead: bool,
    /// True if the power controller reports nothing, as with a broken regulator, so the clocks never start after a reset.
    pub power_dead: bool,
    /// True if nothing is connected to the battery's pin, as when the wire from the voltage divider is broken.
    pub battery_open: bool,
}

/// A microcontroller with what the bench does to it. Port A has the number 0.
pub(crate) trait Part: Mcu + Debug + Send {
    /// Returns the core and its memory. The bench handles accesses to these windows of the processor's own bus.
    fn target(&mut self, own: &[Window]) -> Target<'_>;

    /// Sets the supply voltage, mV. The reference voltage of the converters stays.
    fn set_rail(&mut self, at: VirtualNanos, millivolts: u32);

    /// Updates the interrupt of the voltage detector, after the supply voltage, the detector or EXTI may have changed. A rising
    /// output of the detector causes the interrupt, if its line is unmasked.
    fn follow_detector(&mut self, at: VirtualNanos);

    /// Sets the voltage on the pin of an analog input, mV.
    fn set_input(&mut self, input: AnalogInput, millivolts: u32);

    /// Sets the chip's temperature, in 0.01 degrees Celsius.
    fn set_temperature(&mut self, hundredths: i32);

    /// Returns all pulses on the pin of a servo so far, without a pulse that has not ended.
    fn servo(&self, servo: usize) -> &[ServoPulse];

    /// Connects a device to an I2C bus.
    fn attach_device(&mut self, bus: usize, device: RegisterDevice);

    /// Returns the device of an I2C bus with the number `nth`, from 0.
    fn device(&mut self, bus: usize, nth: usize) -> Option<&mut RegisterDevice>;

    /// Makes a device hold SCL (line 0) or SDA (line 1) of an I2C bus low, or release it.
    fn hold_line(&mut self, at: VirtualNanos, bus: usize, line: usize, low: bool);

    /// Returns the chip if it is an H743, which has faults that the other chip lacks.
    fn h743(&mut self) -> Option<&mut h743::Chip> {
        None
    }

    /// Returns the faults of the chip, which a test begins and ends.
    fn faults(&mut self) -> &mut ChipFaults;

    /// Puts a level on an input of a motor's counter.
    fn drive_encoder(&mut self, at: VirtualNanos, motor: usize, channel: Channel, level: Level);

    /// Puts a level on a pin, or releases the pin.
    fn drive_pin(&mut self, at: VirtualNanos, port: usize, pin: Pin, level: Option<Level>);

    /// Returns the clock of TIM1, Hz.
    fn pwm_hz(&mut self) -> u64;

    /// Returns the pulse that the emulator's own TIM1 makes: high time and period, ns.
    fn pulse(&mut self, channel: Channel) -> Option<(u64, u64)>;

    /// Connects the far ends of the host's two lines and of the chain line, and the pull-up resistors of the I2C buses.
    fn attach(&mut self);

    /// Returns the far end of a line of the host, 0 or 1, or of the chain line, 2.
    fn terminal(&mut self, line: usize) -> Option<&mut Terminal>;

    /// Returns the random errors of bytes to the chip on a line of the host, 0 or 1, or on the chain line, 2.
    fn line_errors(&mut self, line: usize) -> &mut Errors;
}

/// Returns the parts of a core's description that both boards have in the same way.
fn core(board: Board, variant: Variant, interrupt_lines: u16) -> Core {
    let hz = NonZeroU64::new(board.core_hz()).expect("a running clock");
    Core {
        variant,
        clock_hz: hz,
        interrupt_lines: NonZeroU32::new(interrupt_lines.into()).expect("a part with interrupts"),
        // PM0214 4.3, RM0433 19.1.
        priority_bits: 4,
        refclk_divider: NonZeroU32::new(8).expect("a divider"),
        instructions_per_second: hz,
        boot: "flash",
    }
}

/// The board for the emulator. [`Surroundings`](crate::surroundings::Surroundings) drives its pins.
#[derive(Debug)]
pub(crate) struct Nucleo {
    pub(crate) chip: Box<dyn Part>,
    board: Board,
    code: Code,
    connections: Connections,
}

impl Nucleo {
    pub(crate) fn new(board: Board, full_timer: bool, code: Code) -> Result<Self, Error> {
        let connections = Connections::default();
        let chip: Box<dyn Part> = match board {
            Board::NucleoF429zi => Box::new(f427::Chip::new(full_timer)?),
            Board::NucleoH743zi2 => Box::new(h743::Chip::new(full_timer, connections.clone())?),
        };
        Ok(Self { chip, board, code, connections })
    }

    /// Returns the words that the factory writes, with their addresses.
    pub(crate) const fn factory_words(board: Board) -> &'static [(u64, u16)] {
        match board {
            Board::NucleoF429zi => &f427::FACTORY_WORDS,
            Board::NucleoH743zi2 => &h743::FACTORY_WORDS,
        }
    }

    pub(crate) fn port(&mut self, port: usize) -> Port {
        Port::read(&mut *self.chip, self.board, port)
    }

    /// Returns the level of a pin that is no analog input: true if it is high.
    pub(crate) fn is_high(&mut self, (port, pin): (usize, u8)) -> bool {
        peek(&mut *self.chip, wiring::port_at(self.board, port) + wiring::IDR) >> pin & 1 != 0
    }

    /// Puts a level on a pin, or releases the pin.
    pub(crate) fn drive_pin(&mut self, at: u64, (port, pin): (usize, u8), level: Option<bool>) {
        let pin = Pin::new(pin).expect("a pin of a port");
        self.chip.drive_pin(VirtualNanos(at), port, pin, level.map(Level::from));
    }

    /// Returns the registers of TIM1.
    pub(crate) fn pwm(&mut self) -> Registers {
        Registers::read(|offset| peek(&mut *self.chip, wiring::PWM_TIMER + offset))
    }
}

/// Nothing is stored, because runs start from a reset and snapshots of the emulator are not used.
impl Store for Nucleo {}

impl Machine for Nucleo {
    fn name(&self) -> &'static str {
        self.board.name()
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec![self.board.name()]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut *self.chip)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        let mut target = self.chip.target(self.code.windows());
        processor::reuse_core(&mut target.core, self.code, &self.connections);
        vec![target]
    }
}
