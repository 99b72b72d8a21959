//! Battery on ADC1 and VREFINT on ADC3: VREFINT is on ADC3 alone (RM0433 table 209). ADC3 also has the host's [analog
//! inputs](super::analog).

use super::analog::{self, connect};
use crate::supply::{DIVIDER_OHMS, FactoryWord};
use crate::two_converters::{self, ConverterHal, TwoConverters};
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::pac::Interrupt;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::{Boost, SampleTime};
use embassy_stm32::peripherals::{ADC1, ADC3};
use embassy_stm32::{Peri, interrupt, pac, rcc};
use motor_hub::units::RangeError;

/// The reference's converter, and ADC3_IN19, which is VREFINT (RM0433 table 209).
const VREFINT: (Adc, u8) = (pac::ADC3, 19);

/// The converters of battery and reference.
pub type BatteryAdc = TwoConverters<H7>;

/// The converters of an STM32H7.
pub struct H7 {
    inputs: analog::Pins,
}

impl ConverterHal for H7 {
    const INTERRUPT: Interrupt = Interrupt::ADC;
    /// A conversion of 810.5 + 8.5 cycles at 16 MHz takes 51 us.
    const WAIT_MICROS: u64 = 110;
    /// 165 010 cycles of a calibration with linearity (DS12110, ADC characteristics) take 10.3 ms. This value is more than twice as long.
    const CALIBRATION_MS: u32 = 25;

    /// Sets BOOST, the converter's supply current, for its clock. The clock is 16 MHz, and 32 MHz up to revision Y. In
    /// revision Y BOOST is a single bit, which must be set above 20 MHz.
    fn prepare_calibration(converter: Adc) {
        const REVISION_Y: u16 = 0x1003;
        let halves = pac::DBGMCU.idc().read().rev_id() > REVISION_Y;
        converter.cr().modify(|w| {
            w.set_boost(if halves { Boost::LT25 } else { Boost::LT12_5 });
            w.set_adcallin(true);
        });
    }

    /// The longest sampling time is 51 us. VREFINT needs 4.3 us (DS12110), and the divider's 8.9 kohm is a weak source.
    fn connect(converter: Adc, channel: u8) {
        connect(converter, channel, SampleTime::CYCLES810_5);
    }

    fn limit(converter: Adc, low: u16, high: u16) {
        converter.ltr1().write(|w| w.set_ltr1(low.into()));
        converter.htr1().write(|w| w.set_htr1(high.into()));
    }

    fn prepare_reference(&self, converter: Adc, channel: u8) {
        self.inputs.prepare(converter, channel);
    }

    fn take_reference(_: Adc) -> Option<u16> {
        analog::vrefint()
    }

    fn next_reference(_: Adc) {
        analog::next();
    }
}

/// Creates the converters, which are not calibrated yet.
///
/// # Errors
/// [`RangeError::Divider`] if a resistance of the divider is 0.
pub fn battery(
    _: (Peri<'static, ADC1>, Peri<'static, ADC3>),
    pin: impl AdcChannel<ADC1> + 'static,
    inputs: analog::Pins,
) -> Result<BatteryAdc, RangeError> {
    rcc::enable_and_reset::<ADC1>();
    rcc::enable_and_reset::<ADC3>();
    // These bits may be written only while all converters are disabled (RM0433 25.4.10).
    pac::ADC3_COMMON.ccr().modify(|w| {
        w.set_vrefen(true);
        w.set_vsenseen(true);
    });
    let battery = (pac::ADC1, pin.degrade_adc().get_hw_channel());
    TwoConverters::new(H7 { inputs }, battery, VREFINT, FactoryWord::H74X, DIVIDER_OHMS)
}

#[interrupt]
fn ADC() {
    two_converters::handle_watchdog_interrupt(pac::ADC1);
}
