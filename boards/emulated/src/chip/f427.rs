//! The STM32F427, in place of the board's STM32F429. Both have the reference manual RM0090 and the same registers, except
//! for a display controller that the firmware does not use. These models extend the emulator: the EXTI line of the voltage
//! detector, the [sampling capacitor](super::sampling_capacitor) of ADC1, the [timers](super::servo_timer) of the servos, and
//! I2C devices that hold the [lines](super::bus_lines) of their buses.

use delegate::delegate;
use rigless::chip::uart::Errors;
use rigless::cpu::armv7m::{Window, windows};
use rigless::device::{Device, ErasedDevice, Level, ResetCause};
use rigless::machine::Target;
use rigless::machine::armv7m::{Fpu, MpuRegions, Variant};
use rigless::mcu::{Mcu, Operate};
use rigless::soc::st::gpio::Pin;
use rigless::soc::st::tim::Channel;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::pwr::{self, csr};
use rigless::soc::stm32f427::generated::{adc1, exti, tim1, tim9, tim10, tim11};
use rigless::soc::stm32f427::peripherals::i2c::I2c;
use rigless::soc::stm32f427::peripherals::{I2C_INTERFACES, adc, rcc::Apb};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;

use super::bus_lines::Lines;
use super::sampling_capacitor::AdcWithCapacitor;
use super::servo_timer::{ServoPulse, ServoTimer};
use super::{ChipFaults, Part, Port, RAIL_MV, StoredRegisters, core};
use crate::board::Board;
use crate::register_device::RegisterDevice;
use crate::serial::Terminal;
use crate::wiring::{self, AnalogInput};

/// Words that the factory writes, with their addresses (RM0090 39.2, STM32F429 data sheet, "internal reference voltage
/// calibration values"): the flash size in kB, and readings with a supply of 3.3 V and 12 bits. The readings are those of the
/// emulator's VREFINT, 1.21 V, and of its temperature sensor at 30 and at 110 degrees, 0.7725 and 0.9725 V.
pub(super) const FACTORY_WORDS: [(u64, u16); 4] =
    [(0x1FFF_7A22, 2048), (0x1FFF_7A2A, 1501), (0x1FFF_7A2C, 959), (0x1FFF_7A2E, 1207)];

/// Bit of EXTI line 16, which is the line of the voltage detector (RM0090 12.2.5).
const DETECTOR_LINE: u64 = 1 << 16;
/// Number of the detector's interrupt in the emulator's list for PWR.
const DETECTOR_INTERRUPT: usize = 0;

/// ADC1_IN12 is PC2, to which nothing is connected: number of the port, number of the pin, channel.
const UNCONNECTED: (usize, u8, adc::Channel) = (2, 2, adc::Channel::new(12).expect("a channel on a pin"));

const BOARD: Board = Board::NucleoF429zi;

#[derive(Debug)]
pub(super) struct Chip {
    part: Stm32f427,
    full_timer: bool,
    faults: ChipFaults,
    /// ADC1.
    converter: AdcWithCapacitor,
    /// Stands for each peripheral that only stores what is written to it.
    stored: StoredRegisters,
    /// True while the detector's interrupt is pending.
    supply_fell: bool,
    servos: [ServoTimer<Apb>; wiring::SERVOS.len()],
    buses: Vec<Lines<I2c>>,
}

impl Chip {
    pub(super) fn new(full_timer: bool) -> Result<Self, Error> {
        let mut part = Stm32f427::new()?;
        part.set_supply(RAIL_MV);
        let mut converter = AdcWithCapacitor::new();
        for converter in part.adc.iter_mut().chain([&mut converter.converter]) {
            converter.set_reference(RAIL_MV);
            converter.set_backup_battery(RAIL_MV);
        }
        Ok(Self {
            part,
            full_timer,
            // RM0090 2.3.
            servos: [
                ServoTimer::new("TIM10", Apb::Two, &tim10::REGISTERS, 1),
                ServoTimer::new("TIM11", Apb::Two, &tim11::REGISTERS, 1),
                ServoTimer::new("TIM13", Apb::One, &tim10::REGISTERS, 1),
                ServoTimer::new("TIM14", Apb::One, &tim10::REGISTERS, 1),
                ServoTimer::new("TIM12", Apb::One, &tim9::REGISTERS, 2),
                ServoTimer::new("TIM9", Apb::Two, &tim9::REGISTERS, 1),
            ],
            buses: I2C_INTERFACES.map(|name| Lines::new(name, I2c::with_clock(0))).into(),
            faults: ChipFaults::default(),
            converter,
            stored: StoredRegisters(&exti::REGISTERS),
            supply_fell: false,
        })
    }

    /// Updates which pins of ADC1 float. A pin floats if nothing outside is connected to it and the chip does not drive it low.
    fn follow_open_pins(&mut self) {
        let (port, pin, channel) = UNCONNECTED;
        let is_low = Port::read(self, BOARD, port).drives(pin) == Some(false);
        self.converter.converter.set_input(channel, 0);
        let battery = adc::Channel::new(wiring::battery(BOARD).channel).expect("a channel on a pin");
        let open = [(battery, self.faults.battery_open), (channel, !is_low)];
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
        self.servos.iter_mut().for_each(|servo| servo.reset_at(at.0));
        self.buses.iter_mut().for_each(Device::reset);
    }

    delegate! {
        to self.part {
            fn bus(&self) -> &Bus;
            fn bus_mut(&mut self) -> &mut Bus;
            fn poll(&mut self, now: VirtualNanos);
        }
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let name = self.bus().slots()[slot].peripheral().name;
        if name == "ADC1" {
            self.follow_open_pins();
        }
        let model: &mut dyn ErasedDevice = match name {
            "TIM1" if !self.full_timer => self.stored.of(&tim1::REGISTERS),
            "PWR" if self.faults.power_dead => self.stored.of(&pwr::REGISTERS),
            "ADC1" if self.faults.converter_dead => self.stored.of(&adc1::REGISTERS),
            "ADC1" => &mut self.converter,
            "EXTI" => self.stored.of(&exti::REGISTERS),
            _ => {
                if let Some(timer) = self.servos.iter_mut().find(|timer| timer.name == name) {
                    let (rcc, registers) = self.part.clocks();
                    timer.hz = rcc.timer_clock(registers, timer.bus);
                    timer
                } else if let Some(lines) = self.buses.iter_mut().find(|lines| lines.name == name) {
                    lines
                } else {
                    return self.part.split(slot);
                }
            }
        };
        (self.part.bus_mut(), Some(model))
    }
}

impl Part for Chip {
    fn target(&mut self, own: &[Window]) -> Target<'_> {
        let windows = [&windows(self.bus())[..], own].concat();
        let core = core(BOARD, Variant::M4, self.cpu().interrupt_lines);
        let core = core.spec_with_parts(&windows, Fpu::FpV4Sp, MpuRegions::Eight);
        Target::new(BOARD.name(), self, core)
    }

    fn follow_detector(&mut self, at: VirtualNanos) {
        let low = csr::PVDO.is_set(self.part.power().1.get(pwr::Register::Csr));
        let exti = self.part.bus().registers("EXTI").expect("a peripheral of the chip");
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

    fn set_input(&mut self, AnalogInput { adc, channel }: AnalogInput, millivolts: u32) {
        let channel = adc::Channel::new(channel).expect("a channel on a pin");
        let converter = if adc == 1 { &mut self.converter.converter } else { &mut self.part.adc[adc - 1] };
        converter.set_input(channel, millivolts);
    }

    fn set_temperature(&mut self, hundredths: i32) {
        self.converter.converter.set_temperature(hundredths);
    }

    fn drive_encoder(&mut self, at: VirtualNanos, motor: usize, channel: Channel, level: Level) {
        if motor + 1 < wiring::BRIDGES {
            self.part.drive_timer(at, motor, |t, r, c| t.drive_input(channel, level, r, c));
        } else {
            let counter = wiring::LAST_COUNTER;
            self.part.drive_advanced_timer(at, counter, |t, r, c| t.drive_input(channel, level, r, c));
        }
    }

    same_on_every_chip!();
}
