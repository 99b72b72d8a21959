//! The host's analog inputs and the divider of the 5 V rail on ADC2. The rail is the regular group. The inputs are an
//! injected group that is converted after the rail. Each channel has a data register, so no DMA is needed. ADC1 has the
//! temperature sensor.

use super::{inject, set_sampling_time};
use crate::analog::{Newest, Sequence};
use crate::supply::FactoryWord;
use embassy_stm32::adc::{AdcChannel, AnyAdcChannel, SampleTime};
use embassy_stm32::peripherals::ADC2;
use embassy_stm32::{Peri, pac};
use motor_hub::board::{ANALOG_INPUTS, AnalogReadings};

static NEWEST: Newest = Newest::new();

/// Sets the converter up, after ADC1: all converters share one reset and one divider of the clock. Returns the function
/// that reads the inputs.
pub fn set_up(
    _: Peri<'static, ADC2>,
    inputs: [AnyAdcChannel<'static, ADC2>; ANALOG_INPUTS],
    rail: impl AdcChannel<ADC2>,
) -> fn() -> AnalogReadings {
    let inputs = inputs.map(|pin| pin.get_hw_channel());
    let rail = rail.degrade_adc().get_hw_channel();
    pac::RCC.apb2enr().modify(|w| w.set_adc2en(true));
    // The sampling time of 6.9 us suffices for a source of up to 50 kohm with a capacitor, or of 10 kohm without one.
    // Five conversions take 37 us.
    for channel in inputs.into_iter().chain([rail]) {
        set_sampling_time(pac::ADC2, channel, SampleTime::CYCLES144);
    }
    pac::ADC2.sqr3().write(|w| w.set_sq(0, rail));
    inject(pac::ADC2, inputs);
    pac::ADC2.cr1().modify(|w| w.set_jauto(true));
    pac::ADC2.cr2().modify(|w| w.set_adon(true));
    read
}

/// Returns the newest reading of VREFINT, which is the first of ADC1's injected group.
pub(super) fn vrefint() -> u16 {
    pac::ADC1.jdr(0).read().jdata()
}

/// Collects the readings of a sequence that has ended.
fn collect() {
    if pac::ADC2.sr().read().jeoc() {
        pac::ADC2.sr().modify(|w| w.set_jeoc(false));
        let sequence = Sequence {
            inputs: core::array::from_fn(|place| pac::ADC2.jdr(place).read().jdata()),
            rail: pac::ADC2.dr().read().data(),
            // The second of ADC1's injected group.
            temperature: pac::ADC1.jdr(1).read().jdata(),
            vrefint: vrefint(),
        };
        NEWEST.ended(sequence);
    }
}

/// Collects the last sequence, and starts the next one.
pub(super) fn next() {
    collect();
    NEWEST.started();
    pac::ADC2.cr2().modify(|w| {
        // A disturbance may have switched the converter off. It then converts from the next start on.
        w.set_adon(true);
        w.set_swstart(true);
    });
}

/// Returns the newest readings.
fn read() -> AnalogReadings {
    collect();
    NEWEST.readings(FactoryWord::F42X, FactoryWord::F42X_TEMPERATURE)
}
