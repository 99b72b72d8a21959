//! The STM32F427, in place of the board's STM32F429. Both have the reference manual RM0090 and the same registers, except
//! for a display controller that the firmware does not use. These models extend the emulator: the EXTI line of the voltage
//! detector, the [sampling capacitor](super::sampling_capacitor) of ADC1, the [timers](super::servo_timer) of the servos, and
//! I2C devices that hold the [lines](super::bus_lines) of their buses.

use std::num::{NonZeroU32, NonZeroU64};
use std::path::Path;

use rigless::chip::uart::Errors;
use rigless::cpu::armv7m::windows;
use rigless::device::{Device, ErasedDevice, Level, ResetCause};
use rigless::image::Image;
use rigless::machine::Target;
use rigless::machine::armv7m::{Core, Fpu, MpuRegions, Variant};
use rigless::mcu::{Mcu, Operate};
use rigless::soc::st::gpio::Pin;
use rigless::soc::st::tim::Channel;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::pwr::{self, csr};
use rigless::soc::stm32f427::generated::tim1::Register as Tim1;
// All ports have the registers of port I.
use rigless::soc::stm32f427::generated::gpioi::Register as Gpio;
use rigless::soc::stm32f427::generated::{adc1, exti, tim9, tim10, tim11};
use rigless::soc::stm32f427::peripherals::i2c::I2c;
use rigless::soc::stm32f427::peripherals::{I2C_INTERFACES, adc, rcc::Apb};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;

use super::bus_lines::Lines;
use super::sampling_capacitor::AdcWithCapacitor;
use super::servo_timer::{Edge, ServoTimer, Servos};
use super::{PRIORITY_BITS, Part, Port, Pwm, RAIL_MV, REFCLK_DIVIDER, StoredRegisters, port_slots, words};
use crate::board::Board;
use crate::processor::Mpu;
use crate::pwm::Registers;
use crate::register_device::RegisterDevice;
use crate::serial::Terminal;
use crate::wiring;

/// Address of the unique device number, the flash size in kB, and the converter's calibration words (RM0090 39.1 and
/// 39.2, STM32F429 data sheet, "internal reference voltage calibration values").
const FACTORY_WORDS_AT: u64 = 0x1FFF_7A10;

/// Reading of the emulator's VREFINT, 1.21 V, with a supply of 3.3 V and 12 bits.
const VREFINT_CALIBRATION: u16 = 1501;
/// Readings of the emulator's temperature sensor at 30 and at 110 degrees, 0.7725 and 0.9725 V, with a supply of 3.3 V.
const SENSOR_CALIBRATION: [u16; 2] = [959, 1207];

/// Bit of EXTI line 16, which is the line of the voltage detector (RM0090 12.2.5).
const DETECTOR_LINE: u64 = 1 << 16;
/// Number of the detector's interrupt in the emulator's list for PWR.
const DETECTOR_INTERRUPT: usize = 0;

/// ADC1_IN3 is PA3, the battery's divider.
const BATTERY: adc::Channel = adc::Channel::new(3).expect("a channel on a pin");
/// ADC1_IN12 is PC2, to which nothing is connected: number of the port, number of the pin, channel.
const UNCONNECTED: (usize, u8, adc::Channel) = (2, 2, adc::Channel::new(12).expect("a channel on a pin"));

/// The servos whose timers are on APB2: TIM10, TIM11 and TIM9 (RM0090 2.3).
const ON_APB2: [usize; 3] = [0, 1, 5];

/// ADC2_IN4, IN5, IN6 and IN0 are PA4, PA5, PA6 and PA0: the host's analog inputs. ADC2_IN9 is PB1: the 5 V rail's divider.
const ANALOG: [u8; 5] = [4, 5, 6, 0, 9];

/// Returns the calibration words that the factory writes.
pub(super) fn factory_image() -> Result<Image, rigless::image::Error> {
    let mut words = [0_u8; 32];
    words[0x12..0x14].copy_from_slice(&2048_u16.to_le_bytes());
    words[0x1A..0x1C].copy_from_slice(&VREFINT_CALIBRATION.to_le_bytes());
    words[0x1C..0x1E].copy_from_slice(&SENSOR_CALIBRATION[0].to_le_bytes());
    words[0x1E..0x20].copy_from_slice(&SENSOR_CALIBRATION[1].to_le_bytes());
    Image::new(Path::new("factory words"), words.to_vec(), Some(FACTORY_WORDS_AT))
}

/// The board that has this chip.
const BOARD: Board = Board::NucleoF429zi;

/// The microcontroller.
#[derive(Debug)]
pub(super) struct Chip {
    part: Stm32f427,
    pwm: Pwm,
    adc_dead: bool,
    /// ADC1.
    converter: AdcWithCapacitor,
    /// True if nothing is connected to the battery's pin.
    battery_open: bool,
    plain_timer: StoredRegisters<Tim1>,
    plain_converter: StoredRegisters<adc1::Register>,
    plain_exti: StoredRegisters<exti::Register>,
    power_dead: bool,
    plain_power: StoredRegisters<pwr::Register>,
    power_slot: usize,
    timer_slot: usize,
    converter_slot: usize,
    exti_slot: usize,
    port_slots: [usize; wiring::PORTS.len()],
    /// True while the detector's interrupt is pending.
    supply_fell: bool,
    servos: Servos,
    buses: Vec<(usize, Lines<I2c>)>,
}

impl Chip {
    pub(super) fn new(pwm: Pwm) -> Result<Self, Error> {
        let mut part = Stm32f427::new()?;
        part.set_supply(RAIL_MV);
        let mut converter = AdcWithCapacitor::new();
        for converter in part.adc.iter_mut().chain([&mut converter.converter]) {
            converter.set_reference(RAIL_MV);
            converter.set_backup_battery(RAIL_MV);
        }
        let [timer_slot, converter_slot, exti_slot] =
            [part.bus().slot("TIM1")?, part.bus().slot("ADC1")?, part.bus().slot("EXTI")?];
        let power_slot = part.bus().slot("PWR")?;
        let port_slots = port_slots(part.bus())?;
        let slot = |name| part.bus().slot(name);
        let servos: Servos = [
            (slot("TIM10")?, Box::new(ServoTimer::<tim10::Register>::new(1))),
            (slot("TIM11")?, Box::new(ServoTimer::<tim11::Register>::new(1))),
            (slot("TIM13")?, Box::new(ServoTimer::<tim10::Register>::new(1))),
            (slot("TIM14")?, Box::new(ServoTimer::<tim10::Register>::new(1))),
            (slot("TIM12")?, Box::new(ServoTimer::<tim9::Register>::new(2))),
            (slot("TIM9")?, Box::new(ServoTimer::<tim9::Register>::new(1))),
        ];
        let mut buses = Vec::new();
        for name in I2C_INTERFACES {
            buses.push((slot(name)?, Lines::new(I2c::with_clock(0))));
        }
        Ok(Self {
            part,
            pwm,
            servos,
            buses,
            adc_dead: false,
            converter,
            battery_open: false,
            plain_timer: StoredRegisters::default(),
            plain_converter: StoredRegisters::default(),
            plain_exti: StoredRegisters::default(),
            power_dead: false,
            plain_power: StoredRegisters::default(),
            power_slot,
            timer_slot,
            converter_slot,
            exti_slot,
            port_slots,
            supply_fell: false,
        })
    }

    /// Updates which pins of ADC1 float. A pin floats if nothing outside is connected to it and the chip does not drive it low.
    fn follow_open_pins(&mut self) {
        let (port, pin, channel) = UNCONNECTED;
        let is_low = self.port(port).drives(pin) == Some(false);
        self.converter.converter.set_input(channel, 0);
        let open = [(BATTERY, self.battery_open), (channel, !is_low)];
        self.converter.floating.clear();
        self.converter
            .floating
            .extend(open.into_iter().filter_map(|(channel, open)| open.then_some(channel)));
    }
}

impl Mcu for Chip {
    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        // The emulator makes new ports. The levels outside stay.
        let mut ports = std::mem::take(&mut self.part.gpio);
        self.part.reset(at, cause);
        ports.iter_mut().for_each(Device::reset);
        self.part.gpio = ports;
        Device::reset(&mut self.converter);
        self.servos.iter_mut().for_each(|(_, servo)| servo.reset_at(at.0));
        self.buses.iter_mut().for_each(|(_, lines)| Device::reset(lines));
    }

    mcu_on_every_chip!(
        apb: [Apb::One, Apb::Two],
        models: {
            converter_slot if adc_dead => plain_converter,
            converter_slot => converter,
            exti_slot => plain_exti,
        },
        before: converter_slot => follow_open_pins
    );
}

impl Part for Chip {
    fn target(&mut self, mpu: Mpu) -> Target<'_> {
        let board = BOARD;
        let hz = NonZeroU64::new(board.core_hz()).expect("a running clock");
        let lines = u32::from(self.cpu().interrupt_lines);
        let core = Core {
            variant: Variant::M4,
            clock_hz: hz,
            interrupt_lines: NonZeroU32::new(lines).expect("a part with interrupts"),
            priority_bits: PRIORITY_BITS,
            refclk_divider: REFCLK_DIVIDER,
            instructions_per_second: hz,
            boot: "flash",
        }
        .spec_with_parts(
            &[windows(self.bus()), mpu.windows()].concat(),
            Fpu::FpV4Sp,
            MpuRegions::Eight,
        );
        Target::new(board.name(), self, core)
    }

    fn set_rail(&mut self, at: VirtualNanos, millivolts: u32) {
        self.part.set_supply(millivolts);
        self.follow_detector(at);
    }

    fn follow_detector(&mut self, at: VirtualNanos) {
        let low = csr::PVDO.is_set(self.part.power().1.get(pwr::Register::Csr));
        let exti = self.part.bus().slots()[self.exti_slot].registers();
        let lines = exti.get(exti::Register::Imr) & exti.get(exti::Register::Rtsr);
        let fell = low && lines & DETECTOR_LINE != 0;
        if fell != self.supply_fell {
            self.supply_fell = fell;
            self.part.drive_power(at, |_, _, context| context.interrupt(DETECTOR_INTERRUPT, fell.into()));
        }
    }

    fn pwm_hz(&mut self) -> u64 {
        let (rcc, registers) = self.part.clocks();
        rcc.timer_clock(registers, Apb::Two)
    }

    fn set_battery(&mut self, millivolts: u32) {
        self.converter.converter.set_input(BATTERY, millivolts);
    }

    fn open_battery(&mut self, open: bool) {
        self.battery_open = open;
    }

    fn set_current(&mut self, motor: usize, millivolts: u32) {
        // ADC3_IN10, IN13, IN9 and IN15 are PC0, PC3, PF3 and PF5.
        let channel = adc::Channel::new([10, 13, 9, 15][motor]).expect("a channel on a pin");
        self.part.adc[2].set_input(channel, millivolts);
    }

    fn set_analog(&mut self, input: usize, millivolts: u32) {
        let channel = adc::Channel::new(ANALOG[input]).expect("a channel on a pin");
        self.part.adc[1].set_input(channel, millivolts);
    }

    fn set_temperature(&mut self, hundredths: i32) {
        self.converter.converter.set_temperature(hundredths);
    }

    fn delay_currents(&mut self, _: u64) -> bool {
        false
    }

    fn set_dead(&mut self, dead: bool) {
        self.adc_dead = dead;
    }

    fn set_revision(&mut self, _: VirtualNanos, _: u16) {}

    fn drive_encoder(&mut self, at: VirtualNanos, motor: usize, channel: Channel, level: Level) {
        match wiring::ENCODERS[motor] {
            wiring::Counter::General(nth) => {
                self.part.drive_timer(at, nth, |t, r, c| t.drive_input(channel, level, r, c));
            }
            wiring::Counter::Advanced(nth) => {
                self.part.drive_advanced_timer(at, nth, |t, r, c| t.drive_input(channel, level, r, c));
            }
        }
    }

    same_on_every_chip!();
}
