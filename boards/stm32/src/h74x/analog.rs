//! Readings on ADC3: the host's analog inputs, the divider of the 5 V rail, the temperature sensor, and VREFINT. Each sample
//! of the battery starts one sequence of these readings. The FIFO of the data register has room for eight words (RM0433 25.4.27), so
//! there is no DMA.

use crate::analog::{Newest, Sequence};
use crate::supply::FactoryWord;
use crate::two_converters::restart;
use embassy_stm32::adc::AnyAdcChannel;
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::{Pcsel, SampleTime};
use embassy_stm32::peripherals::ADC3;
use motor_hub::board::{ANALOG_INPUTS, AnalogReadings};

/// The channel of the pad PC2_C (STM32H743 data sheet, pin definitions). The package LQFP144 has only this one of the two
/// pads of PC2. The HAL has the channel of the other pad.
pub const PC2_C: u8 = 0;
/// ADC3_INP18 is the temperature sensor (RM0433 table 209).
const TEMPERATURE: u8 = 18;

/// Words of a sequence: the inputs, the rail, the temperature and VREFINT.
const WORDS: usize = ANALOG_INPUTS + 3;

/// Sampling time of the inputs and of the rail: 4 us, for a source of up to 10 kohm with a capacitor.
const QUICK: SampleTime = SampleTime::CYCLES64_5;
/// Sampling time of the temperature sensor and of VREFINT: 24 us. The sensor needs 9 us, and VREFINT 4.3 us (DS12110).
/// The seven conversions of a sequence take 73 us.
const SLOW: SampleTime = SampleTime::CYCLES387_5;

static NEWEST: Newest = Newest::new();

/// The pins of the host's analog inputs and of the divider of the 5 V rail.
pub struct Pins {
    inputs: [u8; ANALOG_INPUTS],
    rail: u8,
}

impl Pins {
    /// Makes the pins analog inputs. `rail` is the pin of the rail's divider, with its channel of ADC3.
    pub fn new(inputs: [AnyAdcChannel<'static, ADC3>; ANALOG_INPUTS], mut rail: (Flex<'static>, u8)) -> Self {
        rail.0.set_as_analog();
        // The pin is never dropped, so it stays an analog input.
        core::mem::forget(rail.0);
        Self { inputs: inputs.map(|pin| pin.get_hw_channel()), rail: rail.1 }
    }

    /// Prepares the sequence of a converter that is calibrated.
    pub(super) fn prepare(&self, converter: Adc, vrefint: u8) {
        let quick = self.inputs.into_iter().chain([self.rail]).map(|channel| (channel, QUICK));
        let slow = [TEMPERATURE, vrefint].map(|channel| (channel, SLOW));
        converter.sqr1().modify(|w| w.set_l(WORDS as u8 - 1));
        for (place, (channel, time)) in quick.chain(slow).enumerate() {
            connect(converter, channel, time);
            // SQR1 has four positions of the sequence, and SQR2 has five (RM0433 25.6.11).
            if place < 4 {
                converter.sqr1().modify(|w| w.set_sq(place, channel));
            } else {
                converter.sqr2().modify(|w| w.set_sq(place - 4, channel));
            }
        }
    }
}

/// Connects a channel to a converter, with this sampling time.
pub(super) fn connect(converter: Adc, channel: u8, time: SampleTime) {
    let (register, place) = (usize::from(channel) / 10, usize::from(channel) % 10);
    converter.smpr(register).modify(|w| w.set_smp(place, time));
    converter.pcsel().modify(|w| w.set_pcsel(channel.into(), Pcsel::PRESELECTED));
}

/// Collects the readings of a sequence that has ended.
fn collect() {
    let converter = pac::ADC3;
    if converter.isr().read().eos() {
        converter.isr().write(|w| w.set_eos(true));
        let [a, b, c, d, rail, temperature, vrefint] =
            core::array::from_fn(|_| converter.dr().read().rdata());
        NEWEST.ended(Sequence { inputs: [a, b, c, d], rail, temperature, vrefint });
    }
}

/// Returns the newest reading of VREFINT.
pub(super) fn vrefint() -> Option<u16> {
    collect();
    NEWEST.get().map(|sequence| sequence.vrefint)
}

/// Starts the next sequence, unless one is running. A running sequence counts as started now: it takes less than 0.1 ms.
pub(super) fn next() {
    let converter = pac::ADC3;
    collect();
    NEWEST.started();
    if !converter.cr().read().adstart() {
        restart(converter);
    }
}

/// Returns the newest readings.
pub fn read() -> AnalogReadings {
    collect();
    NEWEST.readings(FactoryWord::H74X, FactoryWord::H74X_TEMPERATURE)
}
