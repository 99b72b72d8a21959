//! The emulated chip as a board has it: rail, calibration words, no clock from outside, and models that can be taken
//! out or are put in. What the bench wants of any chip is [`Part`]; each chip has a room of its own.

/// What is written the same for every chip, of types that are each chip's own: `self.part`, its slots `timer_slot` and
/// `port_slots`, the registers `Tim1` and `Gpio`, and the board.
macro_rules! same_on_every_chip {
    () => {
        fn drive_pin(&mut self, at: VirtualNanos, port: usize, pin: Pin, level: Option<Level>) {
            self.part.drive_port(at, port, |port, r, c| port.drive(pin, level, r, c));
        }

        fn pin_level(&self, port: usize, pin: Pin) -> Level {
            let registers = self.bus().slots()[self.port_slots[port]].registers();
            self.part.gpio[port].level(pin, registers)
        }

        fn port(&self, port: usize) -> Port {
            let registers = self.bus().slots()[self.port_slots[port]].registers();
            let [modes, outputs] = words(registers, [Gpio::Moder, Gpio::Odr]);
            Port { modes, outputs }
        }

        fn pwm(&self) -> Registers {
            let registers = self.bus().slots()[self.timer_slot].registers();
            let [cr1, psc, arr, bdtr, ccer] =
                words(registers, [Tim1::Cr1, Tim1::Psc, Tim1::Arr, Tim1::Bdtr, Tim1::Ccer]);
            let ccmr = words(registers, [Tim1::Ccmr1Output, Tim1::Ccmr2Output]);
            let ccr = words(registers, [Tim1::Ccr1, Tim1::Ccr2, Tim1::Ccr3, Tim1::Ccr4]);
            Registers { cr1, psc, arr, bdtr, ccer, ccmr, ccr }
        }

        fn pulse(&mut self, channel: Channel) -> Option<(u64, u64)> {
            let (timer, registers) = self.part.advanced_timer(0);
            timer.pulse(channel, registers).map(|pulse| (pulse.width.0, pulse.period.0))
        }

        fn servo(&self, servo: usize) -> &[Edge] {
            self.servos[servo].1.edges()
        }

        fn attach_device(&mut self, bus: usize, device: RegisterDevice) {
            self.buses[bus].1.controller.attach(device);
        }

        fn device(&mut self, bus: usize, nth: usize) -> Option<&mut RegisterDevice> {
            self.buses[bus].1.controller.chip_mut(nth)
        }

        fn hold_lines(&mut self, at: VirtualNanos, bus: usize, low: [bool; 2]) {
            let (slot, lines) = &mut self.buses[bus];
            let (registers, mut context) = self.part.bus_mut().drive(at, *slot);
            lines.hold(low, registers, &mut context);
        }

        fn bus_count(&self) -> usize {
            self.buses.len()
        }

        fn attach(&mut self) {
            for line in wiring::lines(BOARD) {
                self.part.usart[line].attach(Terminal::default());
            }
        }

        fn terminal(&mut self, line: usize) -> Option<&mut Terminal> {
            self.part.usart[wiring::lines(BOARD)[line]].chip_mut()
        }

        fn line_errors(&mut self) -> &mut Errors {
            self.part.usart[wiring::lines(BOARD)[0]].errors_mut()
        }
    };
}

/// Methods of [`Device`](rigless::device::Device) that pass a call on to the emulator's model in a field.
macro_rules! forward {
    ($field:ident: $($method:ident),+) => {
        $(forward!(@$method $field);)+
    };
    (@read $field:ident) => {
        fn read(
            &mut self,
            register: Register,
            registers: &mut RegisterFile,
            context: &mut DeviceContext<'_>,
        ) -> Option<u64> {
            self.$field.read(register, registers, context)
        }
    };
    (@write $field:ident) => {
        fn write(
            &mut self,
            register: Register,
            value: u64,
            registers: &mut RegisterFile,
            context: &mut DeviceContext<'_>,
        ) {
            self.$field.write(register, value, registers, context);
        }
    };
    (@on_clock $field:ident) => {
        fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
            self.$field.on_clock(hz, registers, context);
        }
    };
    (@on_request $field:ident) => {
        fn on_request(
            &mut self,
            request: RequestChange,
            registers: &mut RegisterFile,
            context: &mut DeviceContext<'_>,
        ) {
            self.$field.on_request(request, registers, context);
        }
    };
    (@reset_line $field:ident) => {
        fn reset_line(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
            self.$field.reset_line(registers, context);
        }
    };
}

mod analog_watchdog;
mod bus_lines;
mod f427;
mod flash_interface;
mod h743;
mod late_converter;
mod sampling_capacitor;
mod servo_timer;
mod watchdog;

use std::fmt::Debug;
use std::num::NonZeroU32;

use rigless::chip::uart::Errors;
use rigless::device::{Level, RegisterFile};
use rigless::image::Image;
use rigless::machine::{Board as Machine, Target};
use rigless::mcu::Mcu;
use rigless::snapshot::Store;
use rigless::soc::st::gpio::Pin;
use rigless::soc::st::tim::Channel;
use rigless::soc::{Error, Layout};
use rigless::time::VirtualNanos;

use crate::board::Board;
use crate::processor::{self, Code, Mpu};
use crate::pwm::Registers;
use crate::register_device::RegisterDevice;
use crate::serial::Terminal;
use crate::system_break::Connections;
pub use flash_interface::FlashFaults;
pub(crate) use servo_timer::Edge;

/// The rail, mV.
const RAIL_MV: u32 = 3_300;

/// How much of TIM1 is emulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pwm {
    /// Its registers alone; the waveforms follow from them on the outside. Nothing in the firmware reads
    /// counter or flags, so this is the same to it, and several times faster.
    #[default]
    Registers,
    /// The emulator's own model, which wakes up at every compare.
    Emulated,
}

/// A peripheral that only remembers what is written to it.
#[derive(Debug)]
struct Remembers<R>(core::marker::PhantomData<R>);

impl<R> Default for Remembers<R> {
    fn default() -> Self {
        Self(core::marker::PhantomData)
    }
}

impl<R: Layout> rigless::device::Device for Remembers<R> {
    type Register = R;
}

/// What a port does with its pins.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Port {
    modes: u32,
    outputs: u32,
}

impl Port {
    const fn is_mode(self, pin: u8, mode: u32) -> bool {
        self.modes >> (2 * pin) & 3 == mode
    }

    /// Whether the pin is driven high, if it is driven at all (RM0090 8.4.1, RM0433 11.4.1: mode 1 is an output).
    pub(crate) fn drives(self, pin: u8) -> Option<bool> {
        self.is_mode(pin, 1).then_some(self.outputs >> pin & 1 != 0)
    }

    /// Whether a peripheral has the pin.
    pub(crate) const fn is_function(self, pin: u8) -> bool {
        self.is_mode(pin, 2)
    }
}

/// A microcontroller with what the bench does to it. Motors are by number, ports from A as 0.
pub(crate) trait Part: Mcu + Debug + Send {
    /// The core and its memory, with this much of the MPU.
    fn target(&mut self, mpu: Mpu) -> Target<'_>;

    /// Another rail, mV; the converters' reference stays.
    fn set_rail(&mut self, at: VirtualNanos, millivolts: u32);

    /// Rail, detector or EXTI may have changed: an output of the detector that rises is the interrupt PVD, if its
    /// line is unmasked.
    fn follow_detector(&mut self, at: VirtualNanos);

    /// The voltage on the battery's pin, mV.
    fn set_battery(&mut self, millivolts: u32);

    /// Disconnects the battery's pin from everything, or connects it again.
    fn open_battery(&mut self, open: bool);

    /// The voltage on the pin of a motor's current-sense line, mV.
    fn set_current(&mut self, motor: usize, millivolts: u32);

    /// The voltage on an analog input of the host, 0 to 3, or on the 5 V rail's divider, 4, in mV.
    fn set_analog(&mut self, input: usize, millivolts: u32);

    /// The chip's temperature, 0.01 degrees Celsius.
    fn set_temperature(&mut self, hundredths: i32);

    /// Every edge on the pin of a servo so far.
    fn servo(&self, servo: usize) -> &[Edge];

    /// Number of I2C buses.
    fn bus_count(&self) -> usize;

    /// Connects a device to an I2C bus.
    fn attach_device(&mut self, bus: usize, device: RegisterDevice);

    /// The nth device of an I2C bus.
    fn device(&mut self, bus: usize, nth: usize) -> Option<&mut RegisterDevice>;

    /// A device holds SCL or SDA of an I2C bus low, or releases it.
    fn hold_lines(&mut self, at: VirtualNanos, bus: usize, low: [bool; 2]);

    /// The next conversion of a current ends later by this time; false if it cannot on this chip.
    fn delay_currents(&mut self, nanos: u64) -> bool;

    /// The battery's converter takes commands but converts nothing, or works again.
    fn set_dead(&mut self, dead: bool);

    /// Other faults of the flash. Nothing happens on a chip whose flash has none on the bench.
    fn set_flash_faults(&mut self, _: FlashFaults) {}

    /// The operation of the flash that runs never ends, until a reset; false if the bench cannot do so to this chip.
    fn hold_flash(&mut self) -> bool {
        false
    }

    /// Another revision of the chip, REV_ID. Nothing happens on a chip whose revision the bench does not model.
    fn set_revision(&mut self, at: VirtualNanos, revision: u16);

    /// The power controller only remembers what is written to it, so the clocks never start; or it works again.
    fn set_power_dead(&mut self, dead: bool);

    /// Puts a level on an input of a motor's counter.
    fn drive_encoder(&mut self, at: VirtualNanos, motor: usize, channel: Channel, level: Level);

    /// Puts a level on a pin, or releases the pin.
    fn drive_pin(&mut self, at: VirtualNanos, port: usize, pin: Pin, level: Option<Level>);

    /// What a wire on a pin would see.
    fn pin_level(&self, port: usize, pin: Pin) -> Level;

    /// What a port does.
    fn port(&self, port: usize) -> Port;

    /// TIM1's registers.
    fn pwm(&self) -> Registers;

    /// TIM1's clock, Hz.
    fn pwm_hz(&mut self) -> u64;

    /// The pulse that the emulator's own TIM1 makes: high time and period, ns.
    fn pulse(&mut self, channel: Channel) -> Option<(u64, u64)>;

    /// Connects the far ends of the host's two lines and of the chain line.
    fn attach(&mut self);

    /// The far end of a line of the host, 0 or 1, or of the chain line, 2.
    fn terminal(&mut self, line: usize) -> Option<&mut Terminal>;

    /// What of the chip breaks TIM1. On the F427 nothing does: its SYSCFG has no such register (RM0090 9.2).
    fn connections(&self) -> Connections {
        Connections::default()
    }

    /// What becomes of words on their way to the chip, on line 0.
    fn line_errors(&mut self) -> &mut Errors;
}

/// What registers hold.
fn words<const N: usize>(registers: &RegisterFile, of: [impl Layout; N]) -> [u32; N] {
    of.map(|register| registers.get(register) as u32)
}

/// Priorities and the system timer's divider are the same on both cores (PM0214 4.3, RM0433 19.1).
const PRIORITY_BITS: u8 = 4;
const REFCLK_DIVIDER: NonZeroU32 = NonZeroU32::new(8).expect("a divider");

/// The board as the emulator sees it. What is on its pins is the driver's.
#[derive(Debug)]
pub(crate) struct Nucleo {
    pub(crate) chip: Box<dyn Part>,
    board: Board,
    code: Code,
}

impl Nucleo {
    pub(crate) fn new(board: Board, pwm: Pwm, faults: FlashFaults, code: Code) -> Result<Self, Error> {
        let chip: Box<dyn Part> = match board {
            Board::NucleoF429zi => Box::new(f427::Chip::new(pwm)?),
            Board::NucleoH743zi2 => Box::new(h743::Chip::new(pwm, faults)?),
        };
        Ok(Self { chip, board, code })
    }

    /// The words that the factory writes.
    pub(crate) fn factory_image(board: Board) -> Result<Image, rigless::image::Error> {
        match board {
            Board::NucleoF429zi => f427::factory_image(),
            Board::NucleoH743zi2 => h743::factory_image(),
        }
    }
}

/// Runs start from reset: a plant has no place in the emulator's snapshots.
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
        let connections = self.chip.connections();
        let mut target = self.chip.target(self.code.mpu());
        processor::keep(&mut target.core, self.code, &connections);
        vec![target]
    }
}
