//! The STM32H743 (RM0433). Models of the emulator are replaced where the firmware needs more: the
//! [watchdog](super::watchdog), the [converters](super::converter), and the [flash interface](super::flash_interface). The
//! voltage detector is wired to the EXTI. The [timers](super::servo_timer) of the servos show their pins, and I2C devices
//! can hold the [lines](super::bus_lines) of their buses.

use delegate::delegate;
use rigless::chip::uart::Errors;
use rigless::cpu::armv7m::{Window, windows};
use rigless::device::{Device, ErasedDevice, Level, ResetCause};
use rigless::machine::Target;
use rigless::machine::armv7m::{BranchPrediction, Caches, Config, Fpu, MpuRegions, Variant};
use rigless::mcu::{Mcu, Operate};
use rigless::soc::st::gpio::Pin;
use rigless::soc::st::tim::{Channel, Tim};
use rigless::soc::stm32h743::Stm32h743;
use rigless::soc::stm32h743::generated::pwr::{self, csr1};
use rigless::soc::stm32h743::generated::{dbgmcu, tim1, tim2, tim15, tim16, tim17};
use rigless::soc::stm32h743::peripherals::adc;
use rigless::soc::stm32h743::peripherals::i2c::{self, I2c};
use rigless::soc::stm32h743::peripherals::rcc::TimerBus;
use rigless::soc::stm32h743::peripherals::tim::{ADVANCED_TIMERS, Stm32h743Family, TIMERS};
use rigless::soc::{Bus, Error, Width};
use rigless::time::VirtualNanos;

use super::bus_lines::Lines;
use super::converter::Converter;
use super::flash_interface::Interface;
use super::servo_timer::{ServoPulse, ServoTimer};
use super::watchdog::Watchdog;
use super::{ChipFaults, Part, RAIL_MV, StoredRegisters, core, peek};
use crate::board::Board;
use crate::register_device::RegisterDevice;
use crate::serial::Terminal;
use crate::system_break::{Connections, IDENTITY, OUTPUTS, Source};
use crate::wiring::{self, AnalogInput};

/// Words that the factory writes, with their addresses: TS_CAL1, TS_CAL2 and VREFIN_CAL (DS12110, tables 118 and 181). They are
/// readings with a supply of 3.3 V and 16 bits: of the emulator's temperature sensor at 30 and at 110 degrees, 0.62 and
/// 0.78 V, and of its VREFINT, 1.216 V.
pub(super) const FACTORY_WORDS: [(u64, u16); 3] =
    [(0x1FF1_E820, 12_313), (0x1FF1_E840, 15_490), (0x1FF1_E860, 24_148)];

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

const BOARD: Board = Board::NucleoH743zi2;

#[derive(Debug)]
pub(crate) struct Chip {
    part: Stm32h743,
    full_timer: bool,
    faults: ChipFaults,
    /// Stands for each peripheral that only stores what is written to it.
    stored: StoredRegisters,
    watchdog: Watchdog,
    /// ADC1, ADC2 and ADC3.
    pub(crate) converters: [Converter; 3],
    pub(crate) flash: Interface,
    connections: Connections,
    supply_low: bool,
    servos: [ServoTimer<TimerBus>; wiring::SERVOS.len()],
    buses: Vec<Lines<I2c>>,
}

impl Chip {
    pub(super) fn new(full_timer: bool, connections: Connections) -> Result<Self, Error> {
        let mut part = Stm32h743::new()?;
        part.set_supply(RAIL_MV);
        part.set_analog_supply(RAIL_MV);
        let mut converters = adc::Converter::ALL.map(Converter::new);
        for converter in &mut converters {
            converter.emulated.set_reference(RAIL_MV);
            converter.emulated.set_backup_battery(RAIL_MV);
        }
        Ok(Self {
            part,
            full_timer,
            // RM0433 2.3.
            servos: [
                ServoTimer::new("TIM16", TimerBus::Apb2, &tim16::REGISTERS, 1),
                ServoTimer::new("TIM17", TimerBus::Apb2, &tim17::REGISTERS, 1),
                ServoTimer::new("TIM13", TimerBus::Apb1, &tim2::REGISTERS, 1),
                ServoTimer::new("TIM14", TimerBus::Apb1, &tim2::REGISTERS, 1),
                ServoTimer::new("TIM12", TimerBus::Apb1, &tim2::REGISTERS, 2),
                ServoTimer::new("TIM15", TimerBus::Apb2, &tim15::REGISTERS, 1),
            ],
            buses: i2c::INSTANCES.iter().map(|bus| Lines::new(bus.name, I2c::default())).collect(),
            faults: ChipFaults::default(),
            stored: StoredRegisters(&tim1::REGISTERS),
            watchdog: Watchdog::default(),
            converters,
            flash: Interface::default(),
            connections,
            supply_low: false,
        })
    }

    /// Sets the revision of the chip, REV_ID.
    pub(crate) fn set_revision(&mut self, at: VirtualNanos, revision: u16) {
        let slot = self.bus().slot("DBGMCU").expect("a peripheral of the chip");
        let (registers, _) = self.part.bus_mut().drive(at, slot);
        registers.set(dbgmcu::Register::Idc, u64::from(revision) << 16 | DEVICE);
    }
}

impl Mcu for Chip {
    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
        self.connections.reset();
        Device::reset(&mut self.watchdog);
        self.converters.iter_mut().for_each(Device::reset);
        Device::reset(&mut self.flash);
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
        let model: &mut dyn ErasedDevice = match name {
            "TIM1" if !self.full_timer => self.stored.of(&tim1::REGISTERS),
            "PWR" if self.faults.power_dead => self.stored.of(&pwr::REGISTERS),
            "ADC1" => {
                self.converters[0].dead = self.faults.converter_dead;
                &mut self.converters[0]
            }
            "ADC2" => &mut self.converters[1],
            "ADC3" => &mut self.converters[2],
            "Flash" => &mut self.flash,
            "IWDG" => &mut self.watchdog,
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

/// Drives an input of a timer. The emulator's part cannot drive it, so the timer is taken out of the part meanwhile.
fn drive<F: Stm32h743Family>(
    timer: &mut Tim<F>,
    bus: &mut Bus,
    instance: &'static str,
    at: VirtualNanos,
    (channel, level): (Channel, Level),
) {
    let slot = bus.slot(instance).expect("a timer of the chip");
    let (registers, mut context) = bus.drive(at, slot);
    timer.drive_input(channel, level, registers, &mut context);
}

impl Part for Chip {
    fn target(&mut self, own: &[Window]) -> Target<'_> {
        let windows = [&windows(self.bus())[..], own].concat();
        let core = core(BOARD, Variant::M7, self.cpu().interrupt_lines);
        let mut config = Config::new(core, &windows);
        config.fpu = Fpu::FpV5Dp;
        config.mpu_regions = MpuRegions::Sixteen;
        config.cpuid = CPUID;
        config.caches = Some(CACHES);
        config.branch_prediction = BranchPrediction::Always;
        config.vector_table = Some(VECTOR_TABLE);
        Target::new(BOARD.name(), self, config.spec())
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
            let [identity, outputs] = [IDENTITY, OUTPUTS].map(|at| peek(self, at));
            if let Some(outputs) = self.connections.broken(Source::Detector, identity, outputs) {
                let slot = self.bus().slot("TIM1").expect("a peripheral of the chip");
                let (registers, _) = self.part.bus_mut().drive(at, slot);
                registers.set(tim1::Register::Bdtr, outputs.into());
            }
        }
    }

    fn h743(&mut self) -> Option<&mut Self> {
        Some(self)
    }

    fn pwm_hz(&mut self) -> u64 {
        let (rcc, registers) = self.part.clocks();
        rcc.timer_clock(registers, TimerBus::Apb2)
    }

    fn set_input(&mut self, AnalogInput { adc, channel }: AnalogInput, millivolts: u32) {
        let channel = adc::Channel::new(channel).expect("a channel on a pin");
        self.converters[adc - 1].emulated.set_input(channel, millivolts);
    }

    fn set_temperature(&mut self, hundredths: i32) {
        self.converters[2].emulated.set_temperature(hundredths);
    }

    fn drive_encoder(&mut self, at: VirtualNanos, motor: usize, channel: Channel, level: Level) {
        let part = &mut self.part;
        if motor + 1 < wiring::BRIDGES {
            let of = TIMERS[motor];
            let mut timer = std::mem::replace(&mut part.tim[motor], Tim::new(of));
            drive(&mut timer, part.bus_mut(), of.instance, at, (channel, level));
            part.tim[motor] = timer;
        } else {
            let of = ADVANCED_TIMERS[wiring::LAST_COUNTER];
            let mut timer = std::mem::replace(&mut part.advanced[wiring::LAST_COUNTER], Tim::new(of));
            drive(&mut timer, part.bus_mut(), of.instance, at, (channel, level));
            part.advanced[wiring::LAST_COUNTER] = timer;
        }
    }

    same_on_every_chip!();
}
