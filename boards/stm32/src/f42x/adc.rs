//! Battery, VREFINT and the chip's temperature sensor on ADC1, which converts these three channels in turn
//! without end. The newest readings can always be read. The converter's analog watchdog wakes the core when the battery
//! leaves its quiet range.
//!
//! The HAL supports neither conversions without end nor the analog watchdog. The battery is the regular group, and the
//! others an injected group behind it (RM0090 13.3.9, auto-injection). Each channel has a data register, so there is no
//! DMA. A converter that has stopped raises no new flag; [`BatteryAdc`] then restarts the converter. Each sample of the
//! battery also starts the next sequence of the host's [analog inputs](super::analog), which must be set up.
//!
//! All channels share one sampling capacitor. Without a wire, the battery's pin would keep the voltage of the last conversion.
//! VREFINT would then read as a battery of 11 V. So the injected group ends with a pin that the chip drives low (`ground`): an open
//! battery pin then reads 0 V, which is no battery.

use core::ops::RangeInclusive;

use super::{analog, inject, set_sampling_time};
use crate::Calibrate;
use crate::supply::{DIVIDER_OHMS, FactoryWord, InterruptWaiter, unmask};
use embassy_stm32::Peri;
use embassy_stm32::adc::{Adc, AdcChannel, AnyAdcChannel, SampleTime};
use embassy_stm32::gpio::{Level, Output, Pin, Speed};
use embassy_stm32::pac::Interrupt;
use embassy_stm32::pac::adc::vals::Awdsgl;
use embassy_stm32::peripherals::ADC1;
use embassy_stm32::{interrupt, pac};
use embassy_time::{Duration, Timer, block_for};
use motor_hub::board::SupplyAdc;
use motor_hub::supply::VrefintScale;
use motor_hub::units::{Millivolts, RangeError};

/// ADC1_IN17 is VREFINT (RM0090 13.10).
const VREFINT_CHANNEL: u8 = 17;
/// ADC1_IN18 is the temperature sensor (RM0090 13.10), which works together with VREFINT.
const TEMPERATURE_CHANNEL: u8 = 18;

/// Three conversions of 480 + 12 cycles and one of 28 + 12 at 21 MHz (PCLK2 / 4) take 72 us.
const WAIT_MICROS: u64 = 100;

static WAITER: InterruptWaiter = InterruptWaiter::new();

/// ADC1 with its battery pin.
pub struct BatteryAdc {
    scale: VrefintScale,
    /// Newest reading of VREFINT.
    vrefint: u16,
    _adc: Adc<'static, ADC1>,
    _battery: AnyAdcChannel<'static, ADC1>,
    _ground: Output<'static>,
}

impl BatteryAdc {
    /// Starts the converter, which must be set up before the other converters: its set-up resets all of them. Nothing may be
    /// connected to the pin `ground`.
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance of the divider is 0.
    pub fn new<G: Pin>(
        adc: Peri<'static, ADC1>,
        battery: impl AdcChannel<ADC1> + 'static,
        mut ground: Peri<'static, G>,
    ) -> Result<Self, RangeError>
    where
        for<'a> Peri<'a, G>: AdcChannel<ADC1>,
    {
        let calibration = FactoryWord::F42X.read();
        let (top_ohms, bottom_ohms) = DIVIDER_OHMS;
        let scale = VrefintScale::new(top_ohms, bottom_ohms, calibration)?;
        let battery = battery.degrade_adc();
        let battery_channel = battery.get_hw_channel();
        let ground_channel = ground.reborrow().degrade_adc().get_hw_channel();
        // An output's pin is connected to the converter too (RM0090 8.3, figure 25).
        let ground = Output::new(ground, Level::Low, Speed::Low);
        let adc = Adc::new(adc);
        adc.enable_vrefint();
        // The longest sampling time is 22.9 us. VREFINT and the temperature sensor need 10 us (data sheet), and the
        // divider's 8.9 kohm is a weak source.
        let slow = SampleTime::CYCLES480;
        for channel in [battery_channel, VREFINT_CHANNEL, TEMPERATURE_CHANNEL] {
            set_sampling_time(pac::ADC1, channel, slow);
        }
        // The sampling time is 1.3 us. The capacitor of 7 pF behind 6 kohm (data sheet, ADC characteristics) needs 0.4
        // us.
        set_sampling_time(pac::ADC1, ground_channel, SampleTime::CYCLES28);
        pac::ADC1.sqr3().write(|w| w.set_sq(0, battery_channel));
        inject(pac::ADC1, [VREFINT_CHANNEL, TEMPERATURE_CHANNEL, ground_channel]);
        pac::ADC1.cr1().modify(|w| {
            w.set_jauto(true);
            w.set_awdsgl(Awdsgl::SINGLE_CHANNEL);
            w.set_awdch(battery_channel);
            w.set_awden(true);
        });
        unmask(Interrupt::ADC);
        start();
        Ok(Self { scale, vrefint: calibration.reading, _adc: adc, _battery: battery, _ground: ground })
    }
}

/// Starts the converter. Restarts a converter that runs or has stopped.
fn start() {
    pac::ADC1.cr2().modify(|w| w.set_cont(true));
    power_cycle(pac::ADC1);
    pac::ADC1.cr2().modify(|w| w.set_swstart(true));
}

/// Switches a converter off and on. It is stable after 3 us (STM32F429 data sheet, ADC characteristics, t_STAB). A wait may be
/// shorter than asked for by a microsecond.
pub(super) fn power_cycle(converter: pac::adc::Adc) {
    for on in [false, true] {
        converter.cr2().modify(|w| w.set_adon(on));
        block_for(Duration::from_micros(4));
    }
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
        WAITER.wait(crossed, || pac::ADC1.cr1().modify(|w| w.set_awdie(true))).await;
    }
}

/// Handles the interrupt of the analog watchdog: disables it, and wakes the task once. The flag AWD stays set, because
/// the task reads it.
#[interrupt]
fn ADC() {
    pac::ADC1.cr1().modify(|w| w.set_awdie(false));
    WAITER.wake();
}
