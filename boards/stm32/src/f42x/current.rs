//! The bridges' current-sense lines on ADC3. They are an injected group, in which each channel has
//! a data register, so no DMA is needed. Meanwhile ADC1 watches the battery.

use super::adc::power_cycle;
use super::{inject, set_sampling_time};
use crate::Calibrate;
use crate::bridge_faults::DiagLines;
use embassy_stm32::adc::{AnyAdcChannel, SampleTime};
use embassy_stm32::peripherals::ADC3;
use embassy_stm32::{Peri, pac};
use embassy_time::Timer;
use motor_hub::board::BridgeSensors;
use motor_hub::bridge::{BridgeFeedback, SenseScale};

/// Four conversions of 144 + 12 cycles at 21 MHz take 30 us.
const WAIT_MICROS: u64 = 50;

/// ADC3 with up to four pins, and the DIAG lines of the same bridges.
pub struct CurrentLines<const N: usize> {
    _pins: [AnyAdcChannel<'static, ADC3>; N],
    diag: DiagLines<N>,
}

impl<const N: usize> CurrentLines<N> {
    /// Sets the converter up, after ADC1: all converters share one reset and one divider of the clock. The pins are in the
    /// order of the motors.
    pub fn new(_: Peri<'static, ADC3>, pins: [AnyAdcChannel<'static, ADC3>; N], diag: DiagLines<N>) -> Self {
        let channels = pins.each_ref().map(AnyAdcChannel::get_hw_channel);
        pac::RCC.apb2enr().modify(|w| w.set_adc3en(true));
        // The sampling time of 6.9 us suffices, because the filter's capacitor of 33 nF is at the pin.
        for channel in channels {
            set_sampling_time(pac::ADC3, channel, SampleTime::CYCLES144);
        }
        inject(pac::ADC3, channels);
        pac::ADC3.cr2().modify(|w| w.set_adon(true));
        Self { _pins: pins, diag }
    }
}

impl<const N: usize> Calibrate for CurrentLines<N> {}

impl<const N: usize> BridgeSensors<N> for CurrentLines<N> {
    async fn sample(&mut self) -> [BridgeFeedback; N] {
        pac::ADC3.sr().modify(|w| w.set_jeoc(false));
        pac::ADC3.cr2().modify(|w| w.set_jswstart(true));
        Timer::after_micros(WAIT_MICROS).await;
        let has_converted = pac::ADC3.sr().read().jeoc();
        if !has_converted {
            // The converter has stopped, for example because of a disturbance of its supply. It is ready for the next sample.
            power_cycle(pac::ADC3);
        }
        core::array::from_fn(|place| {
            let reading = pac::ADC3.jdr(place).read().jdata();
            let current = has_converted.then_some(SenseScale::VNH5019_CARRIER.current(reading, 12));
            BridgeFeedback { current, fault: self.diag.has_fault(place) }
        })
    }
}
