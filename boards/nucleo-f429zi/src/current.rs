//! The bridges' current-sense lines (PC0, PC3, PF3, PF5) on ADC3. They are an injected group, in which each channel has
//! a data register, so no DMA is needed. Meanwhile ADC1 watches the battery.

use embassy_stm32::Peri;
use embassy_stm32::adc::SampleTime;
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac;
use embassy_stm32::peripherals::ADC3;
use embassy_time::Timer;
use motor_hub::board::CurrentSense;
use motor_hub::bridge::SenseScale;
use motor_hub::units::Milliamperes;

use motor_hub_stm32::Calibrate;

use crate::MOTORS;

/// ADC3_IN10, IN13, IN9, IN15 (STM32F429 data sheet, pin definitions), by motor.
const CHANNELS: [u8; MOTORS] = [10, 13, 9, 15];

/// Four conversions of 144 + 12 cycles at 21 MHz take 30 us.
const WAIT_MICROS: u64 = 50;

/// ADC3 with its pins.
pub(crate) struct CurrentLines {
    _pins: [Flex<'static>; MOTORS],
}

impl CurrentLines {
    /// Sets the converter up, after ADC1: all converters share one reset and one divider of the clock. The pins belong
    /// to [`CHANNELS`].
    pub(crate) fn new(_: Peri<'static, ADC3>, mut pins: [Flex<'static>; MOTORS]) -> Self {
        pins.iter_mut().for_each(Flex::set_as_analog);
        pac::RCC.apb2enr().modify(|w| w.set_adc3en(true));
        // 6.9 us behind the filter's 33 nF.
        for channel in CHANNELS {
            let slow = SampleTime::CYCLES144;
            match channel.checked_sub(10) {
                Some(nth) => pac::ADC3.smpr1().modify(|w| w.set_smp(nth.into(), slow)),
                None => pac::ADC3.smpr2().modify(|w| w.set_smp(channel.into(), slow)),
            }
        }
        pac::ADC3.jsqr().write(|w| {
            w.set_jl(3);
            for (place, channel) in CHANNELS.into_iter().enumerate() {
                w.set_jsq(place, channel);
            }
        });
        pac::ADC3.cr1().modify(|w| w.set_scan(true));
        pac::ADC3.cr2().modify(|w| w.set_adon(true));
        Self { _pins: pins }
    }
}

impl Calibrate for CurrentLines {}

impl CurrentSense<MOTORS> for CurrentLines {
    async fn sample(&mut self) -> [Option<Milliamperes>; MOTORS] {
        pac::ADC3.sr().modify(|w| w.set_jeoc(false));
        pac::ADC3.cr2().modify(|w| w.set_jswstart(true));
        Timer::after_micros(WAIT_MICROS).await;
        if !pac::ADC3.sr().read().jeoc() {
            // The converter has stopped, for example because of a disturbance of its supply. It is ready for the next sample.
            pac::ADC3.cr2().modify(|w| w.set_adon(false));
            pac::ADC3.cr2().modify(|w| w.set_adon(true));
            return [None; MOTORS];
        }
        core::array::from_fn(|place| {
            Some(SenseScale::VNH5019_CARRIER.current(pac::ADC3.jdr(place).read().jdata(), 12))
        })
    }
}
