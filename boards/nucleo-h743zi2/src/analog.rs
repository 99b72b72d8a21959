//! Readings on ADC3: the host's analog inputs (PF3, PF4, PF5, PF10), the divider of the 5 V rail (PC2), the temperature
//! sensor, and VREFINT. Of the two pads of PC2, the package of this chip has only PC2_C. Each sample of the battery
//! starts one sequence of these readings. The FIFO of the data register has room for eight words (RM0433 25.4.27), so
//! there is no DMA.

use embassy_stm32::gpio::Flex;
use embassy_stm32::pac;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::{Pcsel, SampleTime};
use motor_hub::board::{ANALOG_INPUTS, AnalogReadings};
use motor_hub_stm32::analog::{Factory, Newest, Sequence};
use motor_hub_stm32::supply::FactoryWord;
use motor_hub_stm32::two_converters::restart;

/// ADC3_INP5, INP9, INP4 and INP6 (STM32H743 data sheet, pin definitions), by input.
const INPUTS: [u8; ANALOG_INPUTS] = [5, 9, 4, 6];
/// ADC3_INP0 is the pad PC2_C (STM32H743 data sheet, pin definitions).
const RAIL: u8 = 0;
/// ADC3_INP18 is the temperature sensor (RM0433 table 209).
const TEMPERATURE: u8 = 18;

/// Words of a sequence: the inputs, the rail, the temperature and VREFINT.
const WORDS: usize = ANALOG_INPUTS + 3;

/// 4 us, for a source of up to 10 kohm with a capacitor.
const QUICK: SampleTime = SampleTime::CYCLES64_5;
/// 24 us: the temperature sensor needs 9 us, VREFINT 4.3 us (DS12110). Seven conversions take 73 us.
const SLOW: SampleTime = SampleTime::CYCLES387_5;

static NEWEST: Newest = Newest::new();

/// Makes the pins of [`INPUTS`], and then the pin of [`RAIL`], analog inputs. Returns the function that reads
/// the inputs.
pub(crate) fn set_up(mut pins: [Flex<'static>; ANALOG_INPUTS + 1]) -> fn() -> AnalogReadings {
    pins.iter_mut().for_each(Flex::set_as_analog);
    // The pins are never dropped, so they stay analog inputs.
    core::mem::forget(pins);
    read
}

/// Prepares the sequence of a converter that is calibrated.
pub(crate) fn prepare(converter: Adc, vrefint: u8) {
    let quick = INPUTS.into_iter().chain([RAIL]).map(|channel| (channel, QUICK));
    let slow = [TEMPERATURE, vrefint].map(|channel| (channel, SLOW));
    converter.sqr1().modify(|w| w.set_l(WORDS as u8 - 1));
    for (place, (channel, time)) in quick.chain(slow).enumerate() {
        let (register, position) = (usize::from(channel) / 10, usize::from(channel) % 10);
        converter.smpr(register).modify(|w| w.set_smp(position, time));
        converter.pcsel().modify(|w| w.set_pcsel(channel.into(), Pcsel::PRESELECTED));
        // SQR1 has four positions of the sequence, and SQR2 has five (RM0433 25.6.11).
        if place < 4 {
            converter.sqr1().modify(|w| w.set_sq(place, channel));
        } else {
            converter.sqr2().modify(|w| w.set_sq(place - 4, channel));
        }
    }
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

/// The newest reading of VREFINT.
pub(crate) fn vrefint() -> Option<u16> {
    collect();
    NEWEST.vrefint()
}

/// Starts the next sequence, unless one is running. A running sequence counts as started now: it takes less than 0.1 ms.
pub(crate) fn next() {
    let converter = pac::ADC3;
    collect();
    NEWEST.started();
    if !converter.cr().read().adstart() {
        restart(converter);
    }
}

/// The newest readings.
fn read() -> AnalogReadings {
    collect();
    NEWEST.readings(factory())
}

fn factory() -> Factory {
    Factory::read(FactoryWord::H74X, FactoryWord::H74X_TEMPERATURE)
}
