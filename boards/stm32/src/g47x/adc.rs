//! Battery on ADC1 and VREFINT on ADC3.

use crate::supply::{DIVIDER_OHMS, FactoryWord};
use crate::two_converters::{self, ConverterHal, TwoConverters};
use embassy_stm32::adc::AdcChannel;
use embassy_stm32::pac::Interrupt;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::SampleTime;
use embassy_stm32::pac::adccommon::vals::Ckmode;
use embassy_stm32::peripherals::{ADC1, ADC3};
use embassy_stm32::{Peri, interrupt, pac, rcc};
use motor_hub::units::RangeError;

/// The reference's converter, and ADC3_IN18, which is VREFINT (RM0440 table 163).
const VREFINT: (Adc, u8) = (pac::ADC3, 18);

/// The converters of battery and reference.
pub type BatteryAdc = TwoConverters<G4>;

/// The converters of an STM32G4.
pub struct G4;

impl ConverterHal for G4 {
    const INTERRUPT: Interrupt = Interrupt::ADC1_2;
    /// A conversion of 640.5 + 12.5 cycles at 20 MHz takes 33 us.
    const WAIT_MICROS: u64 = 50;
    /// A calibration takes some microseconds (DS12288, ADC characteristics).
    const CALIBRATION_MS: u32 = 2;

    fn prepare_calibration(_: Adc) {}

    /// The longest sampling time is 32 us. VREFINT needs 4 us (DS12288), and the divider's 8.9 kohm is a weak source.
    fn connect(converter: Adc, channel: u8) {
        let (place, slow) = (usize::from(channel % 10), SampleTime::CYCLES640_5);
        if channel < 10 {
            converter.smpr().modify(|w| w.set_smp(place, slow));
        } else {
            converter.smpr2().modify(|w| w.set_smp(place, slow));
        }
    }

    fn limit(converter: Adc, low: u16, high: u16) {
        converter.tr1().write(|w| {
            w.set_lt1(low);
            w.set_ht1(high);
        });
    }
}

/// Creates the converters, which are not calibrated yet.
///
/// # Errors
/// [`RangeError::Divider`] if a resistance of the divider is 0.
pub fn battery(
    _: (Peri<'static, ADC1>, Peri<'static, ADC3>),
    pin: impl AdcChannel<ADC1> + 'static,
) -> Result<BatteryAdc, RangeError> {
    rcc::enable_and_reset::<ADC1>();
    rcc::enable_and_reset::<ADC3>();
    // The converters get a fourth of the bus's clock. This divider may be set only while all converters are disabled
    // (RM0440 21.7).
    pac::ADC12_COMMON.ccr().modify(|w| w.set_ckmode(Ckmode::SYNC_DIV4));
    pac::ADC345_COMMON.ccr().modify(|w| {
        w.set_ckmode(Ckmode::SYNC_DIV4);
        w.set_vrefen(true);
    });
    let battery = (pac::ADC1, pin.degrade_adc().get_hw_channel());
    TwoConverters::new(G4, battery, VREFINT, FactoryWord::G47X, DIVIDER_OHMS)
}

#[interrupt]
fn ADC1_2() {
    two_converters::handle_watchdog_interrupt(pac::ADC1);
}
