//! The bridges' current-sense lines on ADC2. The FIFO of its data register holds eight words
//! (RM0433 25.4.27), more than the four readings, so no DMA is needed. Meanwhile ADC1 watches the battery.

use super::adc::H7;
use super::analog::connect;
use crate::Calibrate;
use crate::bridge_faults::DiagLines;
use crate::two_converters::{calibrate, power_up, restart};
use embassy_stm32::adc::AnyAdcChannel;
use embassy_stm32::pac::adc::vals::SampleTime;
use embassy_stm32::peripherals::ADC2;
use embassy_stm32::{Peri, pac};
use embassy_time::Timer;
use motor_hub::board::BridgeSensors;
use motor_hub::bridge::{BridgeFeedback, SenseScale};

/// Four conversions of 64.5 + 8.5 cycles at 16 MHz take 18 us.
const WAIT_MICROS: u64 = 40;

/// ADC2 with up to four pins, and the DIAG lines of the same bridges.
pub struct CurrentLines<const N: usize> {
    pins: [AnyAdcChannel<'static, ADC2>; N],
    diag: DiagLines<N>,
}

impl<const N: usize> CurrentLines<N> {
    /// Sets the converter up, after ADC1, which shares clock and reset. It converts nothing before its calibration. The pins
    /// are in the order of the motors.
    pub fn new(_: Peri<'static, ADC2>, pins: [AnyAdcChannel<'static, ADC2>; N], diag: DiagLines<N>) -> Self {
        const { assert!(N > 0 && N <= 4) };
        power_up(pac::ADC2);
        Self { pins, diag }
    }
}

impl<const N: usize> Calibrate for CurrentLines<N> {
    /// Takes some 11 ms. A converter whose calibration does not end gives no readings.
    async fn calibrate(&self) {
        calibrate::<H7>(&[pac::ADC2]).await;
        pac::ADC2.sqr1().write(|w| w.set_l(N as u8 - 1));
        for (place, channel) in self.pins.iter().map(AnyAdcChannel::get_hw_channel).enumerate() {
            // The sampling time of 4 us suffices, because the filter's capacitor of 33 nF is at the pin.
            connect(pac::ADC2, channel, SampleTime::CYCLES64_5);
            pac::ADC2.sqr1().modify(|w| w.set_sq(place, channel));
        }
    }
}

impl<const N: usize> BridgeSensors<N> for CurrentLines<N> {
    async fn sample(&mut self) -> [BridgeFeedback; N] {
        // Discards readings that came too late for the last sample. They would be taken for currents of other motors.
        restart(pac::ADC2);
        Timer::after_micros(WAIT_MICROS).await;
        let has_converted = pac::ADC2.isr().read().eos();
        core::array::from_fn(|bridge| {
            let reading = || SenseScale::VNH5019_CARRIER.current(pac::ADC2.dr().read().rdata(), 16);
            BridgeFeedback { current: has_converted.then(reading), fault: self.diag.has_fault(bridge) }
        })
    }
}
