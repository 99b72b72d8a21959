//! The emulated STM32F427 as this board has it: rail, calibration words, no clock from outside, and two models that
//! can be taken out: TIM1's comparators, which nothing on the chip reads, and a converter that died. One is put in:
//! of the EXTI, which the emulator lacks, the line of the voltage detector.
//!
//! The F427 has the registers of the F429 (one reference manual, RM0090); the F429 adds a display
//! controller that the firmware does not use.

use std::num::{NonZeroU32, NonZeroU64};
use std::path::Path;

use rigless::cpu::armv7m::windows;
use rigless::device::{Device, ErasedDevice, ResetCause};
use rigless::image::Image;
use rigless::machine::armv7m::{Core, Fpu, MpuRegions, Variant};
use rigless::machine::{Board, Target};
use rigless::mcu::{Mcu, Operate};
use rigless::snapshot::Store;
use rigless::soc::stm32f427::Stm32f427;
use rigless::soc::stm32f427::generated::pwr::{self, csr};
use rigless::soc::stm32f427::generated::{adc1, exti, tim1};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;

/// The core clock that the firmware sets up; one instruction per cycle, so times of code are those of
/// a core without wait states.
pub(crate) const CORE_HZ: u64 = 168_000_000;

/// The rail, mV.
const RAIL_MV: u32 = 3_300;

/// Unique device number, flash size in kB, and the converter's calibration words (RM0090 39.1 and
/// 39.2, STM32F429 data sheet, "internal reference voltage calibration values").
const FACTORY_WORDS_AT: u64 = 0x1FFF_7A10;

/// 1.21 V, which the emulator's VREFINT is, read on a 3.3 V rail.
pub(crate) const VREFINT_CALIBRATION: u16 = 1501;

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
#[derive(Debug, Default)]
struct Remembers<R>(core::marker::PhantomData<R>);

impl Device for Remembers<tim1::Register> {
    type Register = tim1::Register;
}

impl Device for Remembers<adc1::Register> {
    type Register = adc1::Register;
}

impl Device for Remembers<exti::Register> {
    type Register = exti::Register;
}

/// EXTI line 16 is the voltage detector's (RM0090 12.2.5).
const DETECTOR_LINE: u64 = 1 << 16;
/// The detector's interrupt, as the emulator's PWR lists it.
const DETECTOR_INTERRUPT: usize = 0;

/// The microcontroller.
#[derive(Debug)]
pub(crate) struct Chip {
    pub(crate) part: Stm32f427,
    pwm: Pwm,
    pub(crate) adc_dead: bool,
    plain_timer: Remembers<tim1::Register>,
    plain_converter: Remembers<adc1::Register>,
    plain_exti: Remembers<exti::Register>,
    timer_slot: usize,
    converter_slot: usize,
    exti_slot: usize,
    /// The detector's interrupt is pending.
    supply_fell: bool,
}

impl Chip {
    /// Another rail, mV; the converters' reference stays.
    pub(crate) fn set_rail(&mut self, at: VirtualNanos, millivolts: u32) {
        self.part.set_supply(millivolts);
        self.follow_detector(at);
    }

    /// Rail, detector or EXTI may have changed: an output of the detector that rises is the interrupt PVD, if its
    /// line is unmasked.
    pub(crate) fn follow_detector(&mut self, at: VirtualNanos) {
        let low = csr::PVDO.is_set(self.part.power().1.get(pwr::Register::Csr));
        let exti = self.part.bus().slots()[self.exti_slot].registers();
        let lines = exti.get(exti::Register::Imr) & exti.get(exti::Register::Rtsr);
        let fell = low && lines & DETECTOR_LINE != 0;
        if fell != self.supply_fell {
            self.supply_fell = fell;
            self.part.drive_power(at, |_, _, context| context.interrupt(DETECTOR_INTERRUPT, fell.into()));
        }
    }
}

impl Mcu for Chip {
    fn bus(&self) -> &Bus {
        self.part.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.part.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.part.reset(at, cause);
    }

    fn poll(&mut self, now: VirtualNanos) {
        self.part.poll(now);
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        if slot == self.timer_slot && self.pwm == Pwm::Registers {
            (self.part.bus_mut(), Some(&mut self.plain_timer))
        } else if slot == self.converter_slot && self.adc_dead {
            (self.part.bus_mut(), Some(&mut self.plain_converter))
        } else if slot == self.exti_slot {
            (self.part.bus_mut(), Some(&mut self.plain_exti))
        } else {
            self.part.split(slot)
        }
    }
}

/// The board as the emulator sees it. What is on its pins is the driver's.
#[derive(Debug)]
pub(crate) struct Nucleo {
    pub(crate) chip: Chip,
}

impl Nucleo {
    pub(crate) fn new(pwm: Pwm) -> Result<Self, Error> {
        let mut part = Stm32f427::new()?;
        part.set_supply(RAIL_MV);
        for converter in &mut part.adc {
            converter.set_reference(RAIL_MV);
            converter.set_backup_battery(RAIL_MV);
        }
        let timer_slot = part.bus().slot("TIM1")?;
        let converter_slot = part.bus().slot("ADC1")?;
        let exti_slot = part.bus().slot("EXTI")?;
        let chip = Chip {
            part,
            pwm,
            adc_dead: false,
            plain_timer: Remembers(core::marker::PhantomData),
            plain_converter: Remembers(core::marker::PhantomData),
            plain_exti: Remembers(core::marker::PhantomData),
            timer_slot,
            converter_slot,
            exti_slot,
            supply_fell: false,
        };
        Ok(Self { chip })
    }

    /// The words that the factory writes.
    pub(crate) fn factory_image() -> Result<Image, rigless::image::Error> {
        let mut words = [0_u8; 32];
        words[0x12..0x14].copy_from_slice(&2048_u16.to_le_bytes());
        words[0x1A..0x1C].copy_from_slice(&VREFINT_CALIBRATION.to_le_bytes());
        Image::new(Path::new("factory words"), words.to_vec(), Some(FACTORY_WORDS_AT))
    }
}

/// Runs start from reset: a plant has no place in the emulator's snapshots.
impl Store for Nucleo {}

impl Board for Nucleo {
    fn name(&self) -> &'static str {
        "nucleo-f429zi"
    }

    fn target_names(&self) -> Vec<&'static str> {
        vec!["stm32f427"]
    }

    fn mcu(&mut self, target: usize) -> Option<&mut dyn Mcu> {
        (target == 0).then_some(&mut self.chip)
    }

    fn targets(&mut self) -> Vec<Target<'_>> {
        const HZ: NonZeroU64 = NonZeroU64::new(CORE_HZ).expect("a running clock");
        let lines = u32::from(self.chip.cpu().interrupt_lines);
        let core = Core {
            variant: Variant::M4,
            clock_hz: HZ,
            interrupt_lines: NonZeroU32::new(lines).expect("a part with interrupts"),
            // PM0214 4.3 and 4.5.
            priority_bits: 4,
            refclk_divider: NonZeroU32::new(8).expect("a divider"),
            instructions_per_second: HZ,
            boot: "flash",
        }
        .spec_with_parts(&windows(self.chip.bus()), Fpu::FpV4Sp, MpuRegions::Eight);
        vec![Target::new("stm32f427", &mut self.chip, core)]
    }
}
