//! The bridges' current-sense lines (PC0, PB1, PA6, PA5) on ADC2. The FIFO of its data register holds eight words
//! (RM0433 25.4.27), more than the four readings, so no DMA is needed. Meanwhile ADC1 watches the battery.

use embassy_stm32::Peri;
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac;
use embassy_stm32::pac::adc::vals::{Pcsel, SampleTime};
use embassy_stm32::peripherals::ADC2;
use embassy_time::Timer;
use motor_hub::board::CurrentSense;
use motor_hub::bridge::SenseScale;
use motor_hub::units::Milliamperes;
use motor_hub_stm32::Calibrate;
use motor_hub_stm32::two_converters::{calibrate, power_up, restart};

use crate::MOTORS;
use crate::adc::H7;

/// ADC12_INP10, INP5, INP3, INP19 (STM32H743 data sheet, pin definitions), by motor.
const CHANNELS: [u8; MOTORS] = [10, 5, 3, 19];

/// Four conversions of 64.5 + 8.5 cycles at 16 MHz take 18 us.
const WAIT_MICROS: u64 = 40;

/// ADC2 with its pins.
pub(crate) struct CurrentLines {
    _pins: [Flex<'static>; MOTORS],
}

impl CurrentLines {
    /// Sets the converter up, after ADC1, which shares clock and reset. It converts nothing before its calibration. The pins
    /// belong to [`CHANNELS`].
    pub(crate) fn new(_: Peri<'static, ADC2>, mut pins: [Flex<'static>; MOTORS]) -> Self {
        pins.iter_mut().for_each(Flex::set_as_analog);
        power_up(pac::ADC2);
        Self { _pins: pins }
    }
}

impl Calibrate for CurrentLines {
    /// Takes some 11 ms. A converter whose calibration does not end gives no readings.
    async fn calibrate(&self) {
        calibrate::<H7>(&[pac::ADC2]).await;
        for channel in CHANNELS {
            // 4 us behind the filter's 33 nF.
            let (register, place) = (usize::from(channel) / 10, usize::from(channel) % 10);
            pac::ADC2.smpr(register).modify(|w| w.set_smp(place, SampleTime::CYCLES64_5));
            pac::ADC2.pcsel().modify(|w| w.set_pcsel(usize::from(channel), Pcsel::PRESELECTED));
        }
        pac::ADC2.sqr1().write(|w| {
            w.set_l(3);
            for (place, channel) in CHANNELS.into_iter().enumerate() {
                w.set_sq(place, channel);
            }
        });
    }
}

impl CurrentSense<MOTORS> for CurrentLines {
    async fn sample(&mut self) -> [Option<Milliamperes>; MOTORS] {
        // Discards readings that came too late for the last sample. They would be taken for currents of other motors.
        restart(pac::ADC2);
        Timer::after_micros(WAIT_MICROS).await;
        if !pac::ADC2.isr().read().eos() {
            return [None; MOTORS];
        }
        core::array::from_fn(|_| Some(SenseScale::VNH5019_CARRIER.current(pac::ADC2.dr().read().rdata(), 16)))
    }
}
