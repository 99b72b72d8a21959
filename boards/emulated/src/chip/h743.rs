//! The STM32H743 (RM0433). Models of the emulator are replaced where the firmware needs more: the
//! [watchdog](super::watchdog), the [analog watchdog](super::analog_watchdog) of a converter, and the [flash
//! interface](super::flash_interface). The voltage detector is wired to the EXTI. A conversion of the currents can be
//! [late](super::late_converter). The [timers](super::servo_timer) of the servos show their pins, and I2C devices can hold the
//! [lines](super::bus_lines) of their buses.

use std::num::{NonZeroU32, NonZeroU64};
use std::path::Path;

use rigless::chip::uart::Errors;
use rigless::cpu::armv7m::windows;
use rigless::device::{Device, ErasedDevice, Level, ResetCause};
use rigless::image::Image;
use rigless::machine::Target;
use rigless::machine::armv7m::{BranchPrediction, Caches, Config, Core, Fpu, MpuRegions, Variant};
use rigless::mcu::{Mcu, Operate};
use rigless::soc::st::gpio::Pin;
use rigless::soc::st::tim::{Channel, Tim};
use rigless::soc::stm32h743::Stm32h743;
// All ports have the registers of port A.
use rigless::soc::stm32h743::generated::gpioa::Register as Gpio;
use rigless::soc::stm32h743::generated::pwr::{self, csr1};
use rigless::soc::stm32h743::generated::tim1::Register as Tim1;
use rigless::soc::stm32h743::generated::{dbgmcu, tim2, tim15, tim16, tim17};
use rigless::soc::stm32h743::peripherals::adc;
use rigless::soc::stm32h743::peripherals::i2c::{self, I2c};
use rigless::soc::stm32h743::peripherals::rcc::TimerBus;
use rigless::soc::stm32h743::peripherals::tim::{ADVANCED_TIMERS, Stm32h743Family, TIMERS};
use rigless::soc::{Bus, Error, Width};
use rigless::time::VirtualNanos;

use super::analog_watchdog::AdcWithWatchdog;
use super::bus_lines::Lines;
use super::flash_interface::{FlashFaults, Interface};
use super::late_converter::DelayedAdc;
use super::servo_timer::{Edge, ServoTimer, Servos};
use super::watchdog::Watchdog;
use super::{PRIORITY_BITS, Part, Port, Pwm, RAIL_MV, REFCLK_DIVIDER, StoredRegisters, port_slots, words};
use crate::board::Board;
use crate::processor::Mpu;
use crate::pwm::Registers;
use crate::register_device::RegisterDevice;
use crate::serial::Terminal;
use crate::system_break::{Connections, Source};
use crate::wiring;

/// Address of TS_CAL1, TS_CAL2 and VREFIN_CAL (DS12110, tables 118 and 181).
const FACTORY_WORDS_AT: u64 = 0x1FF1_E820;

/// Reading of the emulator's VREFINT, 1.216 V, with a supply of 3.3 V and 16 bits.
const VREFINT_CALIBRATION: u16 = 24_148;
/// Readings of the emulator's temperature sensor at 30 and at 110 degrees, 0.62 and 0.78 V, with a supply of 3.3 V.
const SENSOR_CALIBRATION: [u16; 2] = [12_313, 15_490];

/// Address of EXTI_RTSR1, which enables lines of the EXTI for rising edges (RM0433 20.6.1).
const EXTI_RTSR1: u64 = 0x5800_0000;
/// Address of EXTI_SWIER1, which triggers lines of the EXTI (RM0433 20.6.3).
const EXTI_SWIER1: u64 = 0x5800_0008;
/// Bit of EXTI line 16, which is the line of the voltage detector (RM0433 table 150).
const DETECTOR_LINE: u64 = 1 << 16;

/// Address of the vector table at reset: BOOT_ADD0 as the factory programs it (RM0433 table 9).
const VECTOR_TABLE: u32 = 0x0800_0000;

/// CPUID of a Cortex-M7 r1p1 (ES0392 2.1; PM0253 table 52).
const CPUID: u32 = 0x411F_C271;

/// DEV_ID of an STM32H743 (RM0433 60.5.8).
const DEVICE: u64 = 0x450;

/// Registers of the caches, 16 kB each for instructions and data (PM0253 tables 77 and 81). The emulator has only their
/// registers.
const CACHES: Caches = Caches { clidr: 0x0900_0003, ctr: 0x8303_C003, ccsidr: &[0xF00F_E019, 0xF01F_E009] };

/// The servos whose timers are on APB2: TIM16, TIM17 and TIM15 (RM0433 2.3).
const ON_APB2: [usize; 3] = [0, 1, 5];

/// ADC3_INP5, INP9, INP4 and INP6 are PF3, PF4, PF5 and PF10: the host's analog inputs. ADC3_INP0 is PC2_C: the 5 V rail's
/// divider.
const ANALOG: [u8; 5] = [5, 9, 4, 6, 0];

/// Returns the calibration words that the factory writes.
pub(super) fn factory_image() -> Result<Image, rigless::image::Error> {
    let mut words = [0_u8; 0x44];
    words[0x00..0x02].copy_from_slice(&SENSOR_CALIBRATION[0].to_le_bytes());
    words[0x20..0x22].copy_from_slice(&SENSOR_CALIBRATION[1].to_le_bytes());
    words[0x40..0x42].copy_from_slice(&VREFINT_CALIBRATION.to_le_bytes());
    Image::new(Path::new("factory words"), words.to_vec(), Some(FACTORY_WORDS_AT))
}

/// The board that has this chip.
const BOARD: Board = Board::NucleoH743zi2;

/// The microcontroller.
#[derive(Debug)]
pub(super) struct Chip {
    part: Stm32h743,
    pwm: Pwm,
    plain_timer: StoredRegisters<Tim1>,
    watchdog: Watchdog,
    /// ADC1.
    converter: AdcWithWatchdog,
    flash: Interface,
    /// ADC2.
    currents: DelayedAdc,
    /// ADC3.
    inputs: DelayedAdc,
    identity_slot: usize,
    connections: Connections,
    power_dead: bool,
    plain_power: StoredRegisters<pwr::Register>,
    power_slot: usize,
    timer_slot: usize,
    watchdog_slot: usize,
    converter_slot: usize,
    currents_slot: usize,
    inputs_slot: usize,
    flash_slot: usize,
    encoder_slots: [usize; wiring::BRIDGES],
    port_slots: [usize; wiring::PORTS.len()],
    supply_low: bool,
    /// True if nothing is connected to the battery's pin. The pin then keeps its voltage, because ADC1 converts no other channel.
    battery_open: bool,
    servos: Servos,
    buses: Vec<(usize, Lines<I2c>)>,
}

impl Chip {
    pub(super) fn new(pwm: Pwm, faults: FlashFaults) -> Result<Self, Error> {
        let mut part = Stm32h743::new()?;
        part.set_supply(RAIL_MV);
        part.set_analog_supply(RAIL_MV);
        let mut converter = AdcWithWatchdog::new(adc::Converter::Adc1);
        let mut currents = DelayedAdc::new(adc::Converter::Adc2);
        let mut inputs = DelayedAdc::new(adc::Converter::Adc3);
        for converter in [&mut converter.converter, &mut currents.converter, &mut inputs.converter] {
            converter.set_reference(RAIL_MV);
            converter.set_backup_battery(RAIL_MV);
        }
        let slot = |name| part.bus().slot(name);
        let [timer_slot, watchdog_slot, converter_slot] = [slot("TIM1")?, slot("IWDG")?, slot("ADC1")?];
        let servos: Servos = [
            (slot("TIM16")?, Box::new(ServoTimer::<tim16::Register>::new(1))),
            (slot("TIM17")?, Box::new(ServoTimer::<tim17::Register>::new(1))),
            (slot("TIM13")?, Box::new(ServoTimer::<tim2::Register>::new(1))),
            (slot("TIM14")?, Box::new(ServoTimer::<tim2::Register>::new(1))),
            (slot("TIM12")?, Box::new(ServoTimer::<tim2::Register>::new(2))),
            (slot("TIM15")?, Box::new(ServoTimer::<tim15::Register>::new(1))),
        ];
        let mut buses = Vec::new();
        for instance in i2c::INSTANCES {
            buses.push((slot(instance.name)?, Lines::new(I2c::default())));
        }
        let [currents_slot, inputs_slot, flash_slot] = [slot("ADC2")?, slot("ADC3")?, slot("Flash")?];
        let mut encoder_slots = [0; wiring::BRIDGES];
        for (slot, counter) in encoder_slots.iter_mut().zip(&wiring::ENCODERS) {
            *slot = part.bus().slot(match *counter {
                wiring::Counter::General(nth) => TIMERS[nth].instance,
                wiring::Counter::Advanced(nth) => ADVANCED_TIMERS[nth].instance,
            })?;
        }
        let [power_slot, identity_slot] = [part.bus().slot("PWR")?, part.bus().slot("DBGMCU")?];
        let port_slots = port_slots(part.bus())?;
        Ok(Self {
            part,
            pwm,
            servos,
            buses,
            plain_timer: StoredRegisters::default(),
            watchdog: Watchdog::default(),
            converter,
            flash: Interface::new(faults),
            currents,
            inputs,
            identity_slot,
            connections: Connections::default(),
            power_dead: false,
            plain_power: StoredRegisters::default(),
            power_slot,
            timer_slot,
            watchdog_slot,
            converter_slot,
            currents_slot,
            inputs_slot,
            flash_slot,
            encoder_slots,
            port_slots,
            supply_low: false,
            battery_open: false,
        })
    }
}

impl Mcu for Chip {
    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
        self.connections.reset();
        Device::reset(&mut self.watchdog);
        Device::reset(&mut self.converter);
        Device::reset(&mut self.flash);
        Device::reset(&mut self.currents);
        Device::reset(&mut self.inputs);
        self.servos.iter_mut().for_each(|(_, servo)| servo.reset_at(at.0));
        self.buses.iter_mut().for_each(|(_, lines)| Device::reset(lines));
    }

    mcu_on_every_chip!(
        apb: [TimerBus::Apb1, TimerBus::Apb2],
        models: {
            converter_slot => converter,
            flash_slot => flash,
            currents_slot => currents,
            inputs_slot => inputs,
            watchdog_slot => watchdog,
        }
    );
}

/// Drives an input of a timer. The timer is taken out of the emulator's part meanwhile, because the part cannot drive it.
fn drive<F: Stm32h743Family>(
    timer: &mut Tim<F>,
    bus: &mut Bus,
    (at, slot): (VirtualNanos, usize),
    (channel, level): (Channel, Level),
) {
    let (registers, mut context) = bus.drive(at, slot);
    timer.drive_input(channel, level, registers, &mut context);
}

impl Part for Chip {
    fn target(&mut self, mpu: Mpu) -> Target<'_> {
        let board = BOARD;
        let hz = NonZeroU64::new(board.core_hz()).expect("a running clock");
        let lines = u32::from(self.cpu().interrupt_lines);
        let core = Core {
            variant: Variant::M7,
            clock_hz: hz,
            interrupt_lines: NonZeroU32::new(lines).expect("a part with interrupts"),
            priority_bits: PRIORITY_BITS,
            refclk_divider: REFCLK_DIVIDER,
            instructions_per_second: hz,
            boot: "flash",
        };
        let mut config = Config::new(core, &[windows(self.bus()), mpu.windows()].concat());
        config.fpu = Fpu::FpV5Dp;
        config.mpu_regions = MpuRegions::Sixteen;
        config.cpuid = CPUID;
        config.caches = Some(CACHES);
        config.branch_prediction = BranchPrediction::Always;
        config.vector_table = Some(VECTOR_TABLE);
        let spec = config.spec();
        Target::new(board.name(), self, spec)
    }

    fn set_rail(&mut self, at: VirtualNanos, millivolts: u32) {
        self.part.set_supply(millivolts);
        self.follow_detector(at);
    }

    fn follow_detector(&mut self, at: VirtualNanos) {
        let low = csr1::PVDO.is_set(self.part.power().1.get(pwr::Register::Csr1));
        let fell = low && !self.supply_low;
        self.supply_low = low;
        if fell {
            let rising = self.read(at, EXTI_RTSR1, Width::W32).expect("the EXTI's register");
            if rising & DETECTOR_LINE != 0 {
                self.write(at, EXTI_SWIER1, Width::W32, DETECTOR_LINE).expect("the EXTI's register");
            }
            let slots = self.bus().slots();
            let [identity] = words(slots[self.identity_slot].registers(), [dbgmcu::Register::Idc]);
            if let Some(outputs) = self.connections.broken(Source::Detector, identity, self.pwm().bdtr) {
                let (registers, _) = self.part.bus_mut().drive(at, self.timer_slot);
                registers.set(Tim1::Bdtr, outputs.into());
            }
        }
    }

    fn connections(&self) -> Connections {
        self.connections.clone()
    }

    fn pwm_hz(&mut self) -> u64 {
        let (rcc, registers) = self.part.clocks();
        rcc.timer_clock(registers, TimerBus::Apb2)
    }

    fn set_battery(&mut self, millivolts: u32) {
        // ADC12_INP15 is PA3.
        let channel = adc::Channel::new(15).expect("a channel on a pin");
        if !self.battery_open {
            self.converter.converter.set_input(channel, millivolts);
        }
    }

    fn open_battery(&mut self, open: bool) {
        self.battery_open = open;
    }

    fn set_current(&mut self, motor: usize, millivolts: u32) {
        // ADC12_INP10, INP5, INP3 and INP19 are PC0, PB1, PA6 and PA5.
        let channel = adc::Channel::new([10, 5, 3, 19][motor]).expect("a channel on a pin");
        self.currents.converter.set_input(channel, millivolts);
    }

    fn set_analog(&mut self, input: usize, millivolts: u32) {
        let channel = adc::Channel::new(ANALOG[input]).expect("a channel on a pin");
        self.inputs.converter.set_input(channel, millivolts);
    }

    fn set_temperature(&mut self, hundredths: i32) {
        self.inputs.converter.set_temperature(hundredths);
    }

    fn delay_currents(&mut self, nanos: u64) -> bool {
        self.currents.next_is_late_by = Some(nanos);
        true
    }

    fn delay_inputs(&mut self, nanos: u64) -> bool {
        self.inputs.next_is_late_by = Some(nanos);
        true
    }

    fn set_flash_faults(&mut self, faults: FlashFaults) {
        self.flash.faults = faults;
    }

    fn hold_flash(&mut self) -> bool {
        self.flash.never_ends = true;
        true
    }

    fn set_dead(&mut self, dead: bool) {
        self.converter.dead = dead;
    }

    fn set_revision(&mut self, at: VirtualNanos, revision: u16) {
        let (registers, _) = self.part.bus_mut().drive(at, self.identity_slot);
        registers.set(dbgmcu::Register::Idc, u64::from(revision) << 16 | DEVICE);
    }

    fn drive_encoder(&mut self, at: VirtualNanos, motor: usize, channel: Channel, level: Level) {
        let place = (at, self.encoder_slots[motor]);
        let part = &mut self.part;
        match wiring::ENCODERS[motor] {
            wiring::Counter::General(nth) => {
                let mut timer = std::mem::replace(&mut part.tim[nth], Tim::new(TIMERS[nth]));
                drive(&mut timer, part.bus_mut(), place, (channel, level));
                part.tim[nth] = timer;
            }
            wiring::Counter::Advanced(nth) => {
                let mut timer = std::mem::replace(&mut part.advanced[nth], Tim::new(ADVANCED_TIMERS[nth]));
                drive(&mut timer, part.bus_mut(), place, (channel, level));
                part.advanced[nth] = timer;
            }
        }
    }

    same_on_every_chip!();
}
