//! Battery (PA3), VREFINT and the chip's temperature sensor on ADC1, which converts these three channels in turn
//! without end. The newest readings can always be read. The converter's analog watchdog wakes the core when the battery
//! leaves its quiet range.
//!
//! The HAL supports neither conversions without end nor the analog watchdog. The battery is the regular group, and the
//! others an injected group behind it (RM0090 13.3.9, auto-injection). Each channel has a data register, so there is no
//! DMA. A converter that has stopped raises no new flag; [`BatteryAdc`] then restarts the converter. Each sample of the
//! battery also starts the next sequence of the host's [analog inputs](crate::analog).
//!
//! All channels share one sampling capacitor. Without a wire, the battery's pin would keep the voltage of the last conversion.
//! VREFINT would then read as a battery of 11 V. So the injected group ends with a pin that the chip drives low (PC2): an open
//! battery pin then reads 0 V, which is no battery.

use core::ops::RangeInclusive;

use crate::analog;
use embassy_stm32::Peri;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::gpio::{Flex, Level, Output, Speed};
use embassy_stm32::pac::Interrupt;
use embassy_stm32::pac::adc::vals::Awdsgl;
use embassy_stm32::peripherals::{ADC1, PA3, PC2};
use embassy_stm32::{interrupt, pac};
use embassy_time::Timer;
use motor_hub::board::SupplyAdc;
use motor_hub::supply::VrefintScale;
use motor_hub::units::{Millivolts, RangeError};
use motor_hub_stm32::Calibrate;
use motor_hub_stm32::supply::{DIVIDER_OHMS, FactoryWord, Watcher, unmask};

/// ADC1_IN3 is PA3 (STM32F429 data sheet, pin definitions).
const BATTERY_CHANNEL: u8 = 3;
/// ADC1_IN17 is VREFINT (RM0090 13.10).
const VREFINT_CHANNEL: u8 = 17;
/// ADC1_IN18 is the temperature sensor (RM0090 13.10), which works together with VREFINT.
const TEMPERATURE_CHANNEL: u8 = 18;
/// ADC1_IN12 is PC2 (STM32F429 data sheet, pin definitions).
const GROUND_CHANNEL: u8 = 12;

/// Three conversions of 480 + 12 cycles and one of 28 + 12 at 21 MHz (PCLK2 / 4) take 72 us.
const WAIT_MICROS: u64 = 100;

static WATCHER: Watcher = Watcher::new();

/// ADC1 with its battery pin.
pub(crate) struct BatteryAdc {
    scale: VrefintScale,
    /// Newest reading of VREFINT.
    vrefint: u16,
    _adc: Adc<'static, ADC1>,
    _pins: (Flex<'static>, Output<'static>),
}

impl BatteryAdc {
    /// Starts the converter. Nothing may be connected to the pin `ground`.
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance of the divider is 0.
    pub(crate) fn new(
        adc: Peri<'static, ADC1>,
        pin: Peri<'static, PA3>,
        ground: Peri<'static, PC2>,
    ) -> Result<Self, RangeError> {
        let calibration = FactoryWord::F42X.read();
        let (top_ohms, bottom_ohms) = DIVIDER_OHMS;
        let scale = VrefintScale::new(top_ohms, bottom_ohms, calibration)?;
        let mut pin = Flex::new(pin);
        pin.set_as_analog();
        // An output's pin is connected to the converter too (RM0090 8.3, figure 25).
        let ground = Output::new(ground, Level::Low, Speed::Low);
        let adc = Adc::new(adc);
        adc.enable_vrefint();
        // The longest sampling time, 22.9 us: VREFINT and the temperature sensor need 10 us (data sheet), and the divider's
        // 8.9 kohm is a weak source.
        let slow = SampleTime::CYCLES480;
        pac::ADC1.smpr2().modify(|w| w.set_smp(usize::from(BATTERY_CHANNEL), slow));
        for channel in [VREFINT_CHANNEL, TEMPERATURE_CHANNEL] {
            pac::ADC1.smpr1().modify(|w| w.set_smp(usize::from(channel) - 10, slow));
        }
        // 1.3 us: the capacitor's 7 pF behind 6 kohm (data sheet, ADC characteristics) need 0.4 us.
        let quick = SampleTime::CYCLES28;
        pac::ADC1.smpr1().modify(|w| w.set_smp(usize::from(GROUND_CHANNEL) - 10, quick));
        pac::ADC1.sqr3().write(|w| w.set_sq(0, BATTERY_CHANNEL));
        // A group of three channels uses the last three of the four positions in JSQR (RM0090 13.13.12).
        pac::ADC1.jsqr().write(|w| {
            w.set_jl(2);
            w.set_jsq(1, VREFINT_CHANNEL);
            w.set_jsq(2, TEMPERATURE_CHANNEL);
            w.set_jsq(3, GROUND_CHANNEL);
        });
        pac::ADC1.cr1().modify(|w| {
            // Without SCAN only one channel of the injected group is converted (RM0090 13.3.8).
            w.set_scan(true);
            w.set_jauto(true);
            w.set_awdsgl(Awdsgl::SINGLE_CHANNEL);
            w.set_awdch(BATTERY_CHANNEL);
            w.set_awden(true);
        });
        unmask(Interrupt::ADC);
        start();
        Ok(Self { scale, vrefint: calibration.reading, _adc: adc, _pins: (pin, ground) })
    }
}

/// Starts the converter, or restarts it in whatever state it is.
fn start() {
    pac::ADC1.cr2().modify(|w| w.set_adon(false));
    pac::ADC1.cr2().modify(|w| {
        w.set_cont(true);
        w.set_adon(true);
    });
    pac::ADC1.cr2().modify(|w| w.set_swstart(true));
}

/// True if VREFINT, and the battery before it, has been converted since the last call.
fn is_new() -> bool {
    let new = pac::ADC1.sr().read().jeoc();
    // A flag that is raised between these two lines is lost. The next conversion raises the flag again.
    pac::ADC1.sr().modify(|w| w.set_jeoc(false));
    new
}

impl Calibrate for BatteryAdc {}

impl SupplyAdc for BatteryAdc {
    async fn sample(&mut self) -> Option<Millivolts> {
        analog::next();
        if !is_new() {
            Timer::after_micros(WAIT_MICROS).await;
            if !is_new() {
                start();
                return None;
            }
        }
        self.vrefint = analog::vrefint();
        self.scale.battery(pac::ADC1.dr().read().data(), self.vrefint)
    }

    async fn wait_until_outside(&mut self, quiet: RangeInclusive<Millivolts>) {
        let reading = |voltage: &Millivolts| self.scale.reading(*voltage, self.vrefint);
        pac::ADC1.ltr().write(|w| w.set_lt(reading(quiet.start())));
        pac::ADC1.htr().write(|w| w.set_ht(reading(quiet.end())));
        pac::ADC1.sr().modify(|w| w.set_awd(false));
        let crossed = || pac::ADC1.sr().read().awd();
        WATCHER.wait(crossed, || pac::ADC1.cr1().modify(|w| w.set_awdie(true))).await;
    }
}

/// Handles the interrupt of the analog watchdog: disables it, and wakes the task once. The flag AWD stays set, because
/// the task reads it.
#[interrupt]
fn ADC() {
    pac::ADC1.cr1().modify(|w| w.set_awdie(false));
    WATCHER.wake();
}
