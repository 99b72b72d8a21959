//! The emulated chip of a board: its supply voltage, its calibration words, and models that replace or extend those of the
//! emulator. [`Part`] has what the bench needs of any chip. Each chip implements it in a module of its own.

/// Methods of [`Part`] whose text is the same for every chip, while their types differ. They use the chip's `self.part`,
/// `timer_slot` and `port_slots`, the registers `Tim1` and `Gpio`, and `BOARD`.
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

        fn hold_line(&mut self, at: VirtualNanos, bus: usize, line: usize, low: bool) {
            let (slot, lines) = &mut self.buses[bus];
            let (registers, mut context) = self.part.bus_mut().drive(at, *slot);
            lines.hold(line, low, registers, &mut context);
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

        fn line_errors(&mut self, line: usize) -> &mut Errors {
            self.part.usart[wiring::lines(BOARD)[line]].errors_mut()
        }

        fn set_power_dead(&mut self, dead: bool) {
            self.power_dead = dead;
        }
    };
}

/// Methods of [`Mcu`] whose text is the same for every chip. They use the fields that `same_on_every_chip` uses, and
/// the chip's own models. `apb` gives the buses of the servos' timers. `models` lists the slots whose model is
/// replaced. An entry names a slot and its model. A field between them, if there is one, must be true for the entry.
/// The first entry that fits is used. `before` names a slot, and a method that is called before each access to the
/// slot.
macro_rules! mcu_on_every_chip {
    (
        apb: [$one:expr, $two:expr],
        models: { $($slot:ident $(if $active:ident)? => $model:ident),+ $(,)? }
        $(, before: $before:ident => $update:ident)?
    ) => {
        fn bus(&self) -> &Bus {
            self.part.bus()
        }

        fn bus_mut(&mut self) -> &mut Bus {
            self.part.bus_mut()
        }

        fn poll(&mut self, now: VirtualNanos) {
            self.part.poll(now);
        }

        fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
            $(
                if slot == self.$before {
                    self.$update();
                }
            )?
            if slot == self.timer_slot && self.pwm == Pwm::Registers {
                return (self.part.bus_mut(), Some(&mut self.plain_timer));
            }
            if slot == self.power_slot && self.power_dead {
                return (self.part.bus_mut(), Some(&mut self.plain_power));
            }
            $(
                if slot == self.$slot $(&& self.$active)? {
                    return (self.part.bus_mut(), Some(&mut self.$model));
                }
            )+
            if let Some(servo) = self.servos.iter().position(|(place, _)| *place == slot) {
                let bus = if ON_APB2.contains(&servo) { $two } else { $one };
                let (rcc, registers) = self.part.clocks();
                let hz = rcc.timer_clock(registers, bus);
                let timer = &mut self.servos[servo].1;
                timer.set_clock(hz);
                return (self.part.bus_mut(), Some(&mut **timer));
            }
            if let Some((_, lines)) = self.buses.iter_mut().find(|(place, _)| *place == slot) {
                return (self.part.bus_mut(), Some(lines));
            }
            self.part.split(slot)
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
use rigless::soc::{Bus, Error, Layout};
use rigless::time::VirtualNanos;

use crate::board::Board;
use crate::processor::{self, Code, Mpu};
use crate::pwm::Registers;
use crate::register_device::RegisterDevice;
use crate::serial::Terminal;
use crate::system_break::Connections;
use crate::wiring;
pub use flash_interface::FlashFaults;
pub(crate) use servo_timer::Edge;

/// Supply voltage of the chip, mV.
const RAIL_MV: u32 = 3_300;

/// How much of TIM1 is emulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pwm {
    /// The registers alone are emulated, and the bench computes the waveforms from them. The firmware reads neither counter nor
    /// flags, so it finds no difference. This is several times faster.
    #[default]
    Registers,
    /// The emulator's own model is used, which has an event at every compare.
    Emulated,
}

/// A peripheral that only stores what is written to its registers.
#[derive(Debug)]
struct StoredRegisters<R>(core::marker::PhantomData<R>);

impl<R> Default for StoredRegisters<R> {
    fn default() -> Self {
        Self(core::marker::PhantomData)
    }
}

impl<R: Layout> rigless::device::Device for StoredRegisters<R> {
    type Register = R;
}

/// Modes and output levels of the pins of a port.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Port {
    modes: u32,
    outputs: u32,
}

impl Port {
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

/// A microcontroller with what the bench does to it. Port A has the number 0.
pub(crate) trait Part: Mcu + Debug + Send {
    /// Returns the core and its memory, with this emulation of the memory protection unit.
    fn target(&mut self, mpu: Mpu) -> Target<'_>;

    /// Sets the supply voltage, mV. The reference voltage of the converters stays.
    fn set_rail(&mut self, at: VirtualNanos, millivolts: u32);

    /// Updates the interrupt of the voltage detector, after the supply voltage, the detector or EXTI may have changed. A rising
    /// output of the detector causes the interrupt, if its line is unmasked.
    fn follow_detector(&mut self, at: VirtualNanos);

    /// Sets the voltage on the battery's pin, mV.
    fn set_battery(&mut self, millivolts: u32);

    /// Disconnects the battery's pin, or connects it again.
    fn open_battery(&mut self, open: bool);

    /// Sets the voltage on the pin of a motor's current-sense line, mV.
    fn set_current(&mut self, motor: usize, millivolts: u32);

    /// Sets the voltage in mV on an analog input of the host, 0 to 3, or on the divider of the 5 V rail, 4.
    fn set_analog(&mut self, input: usize, millivolts: u32);

    /// Sets the chip's temperature, in 0.01 degrees Celsius.
    fn set_temperature(&mut self, hundredths: i32);

    /// Returns all edges on the pin of a servo so far.
    fn servo(&self, servo: usize) -> &[Edge];

    /// Returns the number of I2C buses.
    fn bus_count(&self) -> usize;

    /// Connects a device to an I2C bus.
    fn attach_device(&mut self, bus: usize, device: RegisterDevice);

    /// Returns the device of an I2C bus with the number `nth`, from 0.
    fn device(&mut self, bus: usize, nth: usize) -> Option<&mut RegisterDevice>;

    /// Makes a device hold SCL (line 0) or SDA (line 1) of an I2C bus low, or release it.
    fn hold_line(&mut self, at: VirtualNanos, bus: usize, line: usize, low: bool);

    /// Makes the next conversion of a current end later by this time. Returns false if the bench cannot do this on this chip.
    fn delay_currents(&mut self, nanos: u64) -> bool;

    /// Makes the running conversion of the reference or an analog input end later by this time. Returns false if the bench cannot do
    /// this on this chip.
    fn delay_inputs(&mut self, _: u64) -> bool {
        false
    }

    /// If `dead` is true, the battery's converter accepts commands but converts nothing. Otherwise it works again.
    fn set_dead(&mut self, dead: bool);

    /// Sets the faults of the flash. This does nothing on a chip whose flash is modelled without faults.
    fn set_flash_faults(&mut self, _: FlashFaults) {}

    /// Makes the flash stay busy until a reset. Returns false if the bench cannot do this on this chip.
    fn hold_flash(&mut self) -> bool {
        false
    }

    /// Sets the revision of the chip, REV_ID. This does nothing on a chip whose revision is not modelled.
    fn set_revision(&mut self, at: VirtualNanos, revision: u16);

    /// If `dead` is true, the power controller only stores what is written to it, so the clocks never start. Otherwise
    /// it works again.
    fn set_power_dead(&mut self, dead: bool);

    /// Puts a level on an input of a motor's counter.
    fn drive_encoder(&mut self, at: VirtualNanos, motor: usize, channel: Channel, level: Level);

    /// Puts a level on a pin, or releases the pin.
    fn drive_pin(&mut self, at: VirtualNanos, port: usize, pin: Pin, level: Option<Level>);

    /// Returns the level of a pin.
    fn pin_level(&self, port: usize, pin: Pin) -> Level;

    /// Returns modes and output levels of a port.
    fn port(&self, port: usize) -> Port;

    /// Returns the registers of TIM1.
    fn pwm(&self) -> Registers;

    /// Returns the clock of TIM1, Hz.
    fn pwm_hz(&mut self) -> u64;

    /// Returns the pulse that the emulator's own TIM1 makes: high time and period, ns.
    fn pulse(&mut self, channel: Channel) -> Option<(u64, u64)>;

    /// Connects the far ends of the host's two lines and of the chain line.
    fn attach(&mut self);

    /// Returns the far end of a line of the host, 0 or 1, or of the chain line, 2.
    fn terminal(&mut self, line: usize) -> Option<&mut Terminal>;

    /// Returns the sources that switch the outputs of TIM1 off, by a break input of the timer. The F427 has none, because its SYSCFG
    /// has no register for them (RM0090 9.2).
    fn connections(&self) -> Connections {
        Connections::default()
    }

    /// Returns the random errors of bytes to the chip on a line of the host, 0 or 1, or on the chain line, 2.
    fn line_errors(&mut self, line: usize) -> &mut Errors;
}

/// Returns the contents of registers.
fn words<const N: usize>(registers: &RegisterFile, of: [impl Layout; N]) -> [u32; N] {
    of.map(|register| registers.get(register) as u32)
}

/// Returns the numbers of all ports on the emulator's bus.
fn port_slots(bus: &Bus) -> Result<[usize; wiring::PORTS.len()], Error> {
    let mut slots = [0; wiring::PORTS.len()];
    for (slot, name) in slots.iter_mut().zip(wiring::PORTS) {
        *slot = bus.slot(name)?;
    }
    Ok(slots)
}

/// Number of bits of an interrupt's priority, on both cores (PM0214 4.3, RM0433 19.1).
const PRIORITY_BITS: u8 = 4;
/// Divider of the system timer's reference clock, on both cores.
const REFCLK_DIVIDER: NonZeroU32 = NonZeroU32::new(8).expect("a divider");

/// The board for the emulator. [`Surroundings`](crate::surroundings::Surroundings) drives its pins.
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

    /// Returns the calibration words that the factory writes.
    pub(crate) fn factory_image(board: Board) -> Result<Image, rigless::image::Error> {
        match board {
            Board::NucleoF429zi => f427::factory_image(),
            Board::NucleoH743zi2 => h743::factory_image(),
        }
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
        let connections = self.chip.connections();
        let mut target = self.chip.target(self.code.mpu());
        processor::reuse_core(&mut target.core, self.code, &connections);
        vec![target]
    }
}
