//! The host's analog inputs (PA4, PA5, PA6, PA0) and the divider of the 5 V rail (PB1) on ADC2. The rail is the regular
//! group. The inputs are an injected group that is converted after the rail. Each channel has a data register, so no
//! DMA is needed. ADC1 has the temperature sensor.

use embassy_stm32::adc::SampleTime;
use embassy_stm32::gpio::Flex;
use embassy_stm32::peripherals::ADC2;
use embassy_stm32::{Peri, pac};
use motor_hub::board::{ANALOG_INPUTS, AnalogReadings};
use motor_hub_stm32::analog::{Factory, Newest, Sequence};
use motor_hub_stm32::supply::FactoryWord;

/// ADC2_IN4, IN5, IN6 and IN0 (STM32F429 data sheet, pin definitions), by input.
const INPUTS: [u8; ANALOG_INPUTS] = [4, 5, 6, 0];
/// ADC2_IN9 is PB1 (STM32F429 data sheet, pin definitions).
const RAIL: u8 = 9;

static NEWEST: Newest = Newest::new();

/// Sets the converter up, after ADC1: all converters share one reset and one divider of the clock. The pins are those of
/// [`INPUTS`], and then that of [`RAIL`]. Returns the function that reads the inputs.
pub(crate) fn set_up(
    _: Peri<'static, ADC2>,
    mut pins: [Flex<'static>; ANALOG_INPUTS + 1],
) -> fn() -> AnalogReadings {
    pins.iter_mut().for_each(Flex::set_as_analog);
    // The pins are never dropped, so they stay analog inputs.
    core::mem::forget(pins);
    pac::RCC.apb2enr().modify(|w| w.set_adc2en(true));
    // 6.9 us, for a source of up to 50 kohm with a capacitor, or of 10 kohm without one. Five conversions take 37 us.
    for channel in INPUTS.into_iter().chain([RAIL]) {
        pac::ADC2.smpr2().modify(|w| w.set_smp(channel.into(), SampleTime::CYCLES144));
    }
    pac::ADC2.sqr3().write(|w| w.set_sq(0, RAIL));
    pac::ADC2.jsqr().write(|w| {
        w.set_jl(3);
        for (place, channel) in INPUTS.into_iter().enumerate() {
            w.set_jsq(place, channel);
        }
    });
    pac::ADC2.cr1().modify(|w| {
        w.set_scan(true);
        w.set_jauto(true);
    });
    pac::ADC2.cr2().modify(|w| w.set_adon(true));
    read
}

/// The newest reading of VREFINT, which is the first of ADC1's injected group.
pub(crate) fn vrefint() -> u16 {
    pac::ADC1.jdr(0).read().jdata()
}

/// The newest reading of the temperature sensor, which is the second of ADC1's injected group.
fn temperature() -> u16 {
    pac::ADC1.jdr(1).read().jdata()
}

/// Collects the readings of a sequence that has ended.
fn collect() {
    if pac::ADC2.sr().read().jeoc() {
        pac::ADC2.sr().modify(|w| w.set_jeoc(false));
        let sequence = Sequence {
            inputs: core::array::from_fn(|place| pac::ADC2.jdr(place).read().jdata()),
            rail: pac::ADC2.dr().read().data(),
            temperature: temperature(),
            vrefint: vrefint(),
        };
        NEWEST.ended(sequence);
    }
}

/// Collects the last sequence, and starts the next one.
pub(crate) fn next() {
    collect();
    NEWEST.started();
    pac::ADC2.cr2().modify(|w| {
        // A disturbance may have switched the converter off. It then converts from the next start on.
        w.set_adon(true);
        w.set_swstart(true);
    });
}

/// The newest readings.
fn read() -> AnalogReadings {
    collect();
    NEWEST.readings(factory())
}

fn factory() -> Factory {
    Factory::read(FactoryWord::F42X, FactoryWord::F42X_TEMPERATURE)
}
