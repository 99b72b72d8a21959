//! Measures the battery and the chip's internal voltage reference VREFINT, each on an ADC (*converter*) of its own, as on the
//! STM32G4 and the STM32H7.
//!
//! The battery's converter converts without end, so its newest reading can always be read. Its analog watchdog wakes the core
//! when the battery leaves its quiet range. The reference's converter converts without end too, unless the chip converts other
//! channels there: then it converts VREFINT and those channels once for each sample of the battery.
//!
//! The HAL has neither conversions without end nor the analog watchdog, and its calibration blocks the core. Each converter
//! needs no more than its data register, so there is no DMA. A converter that has stopped is found because it does not set its
//! flag EOC (end of conversion) again.

use crate::Calibrate;
use crate::supply::{FactoryWord, InterruptWaiter, unmask};
use core::ops::RangeInclusive;
use embassy_stm32::pac::Interrupt;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::{Adstp, Awd1sgl, Ovrmod};
use embassy_time::{Duration, Instant, Timer};
use motor_hub::board::SupplyAdc;
use motor_hub::supply::VrefintScale;
use motor_hub::units::{Millivolts, RangeError};

/// Number of reads of a register, some microseconds, after which a converter that has not stopped never stops.
const STOP_READS: u32 = 200;

/// Time without a new reading of the reference after which the last reading is not used. The supply voltage changes
/// slowly.
const REFERENCE_STALE: Duration = Duration::from_millis(25);

static WAITER: InterruptWaiter = InterruptWaiter::new();

/// The properties in which the converters of two chips differ.
pub trait ConverterHal {
    /// Interrupt of the battery's converter.
    const INTERRUPT: Interrupt;
    /// Time in which the battery's converter ends a conversion, in microseconds.
    const WAIT_MICROS: u64;
    /// Longest time of a calibration, in milliseconds.
    const CALIBRATION_MS: u32;

    /// Sets what the chip needs before a calibration. The registers select single-ended inputs after a reset.
    fn prepare_calibration(converter: Adc);

    /// Connects a channel to a converter, with the longest sampling time.
    fn connect(converter: Adc, channel: u8);

    /// Sets the readings at which the analog watchdog triggers.
    fn limit(converter: Adc, low: u16, high: u16);

    /// Prepares the reference's converter, whose channel is connected already. This default converts the reference without end.
    fn prepare_reference(&self, converter: Adc, channel: u8) {
        convert_without_end(converter, channel);
    }

    /// Takes a new reading of the reference. This default reads the converter that converts without end.
    fn take_reference(converter: Adc) -> Option<u16> {
        let new = converter.isr().read().eoc();
        // Reading clears the flag.
        new.then(|| converter.dr().read().rdata())
    }

    /// Starts the next conversions of the reference's converter. This default does nothing: the converter runs without end.
    fn next_reference(_converter: Adc) {}
}

/// The two converters.
pub struct TwoConverters<K> {
    hal: K,
    scale: VrefintScale,
    /// Newest reading of VREFINT, and when it was taken.
    vrefint: u16,
    vrefint_at: Option<Instant>,
    /// Converter and channel of the battery.
    battery: (Adc, u8),
    /// Converter and channel of VREFINT.
    reference: (Adc, u8),
}

impl<K: ConverterHal> TwoConverters<K> {
    /// Takes converters that have their clock and are disabled, and whose pins are analog inputs. They convert nothing before their calibration.
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance of the divider, to the battery or to ground, is 0.
    pub fn new(
        hal: K,
        battery: (Adc, u8),
        reference: (Adc, u8),
        word: FactoryWord,
        (top_ohms, bottom_ohms): (u32, u32),
    ) -> Result<Self, RangeError> {
        let calibration = word.read();
        let scale = VrefintScale::new(top_ohms, bottom_ohms, calibration)?;
        for (converter, _) in [battery, reference] {
            power_up(converter);
        }
        let vrefint = calibration.reading;
        Ok(Self { hal, scale, vrefint, vrefint_at: None, battery, reference })
    }

    fn converters(&self) -> [(Adc, u8); 2] {
        [self.battery, self.reference]
    }

    /// Takes new readings of battery and reference. Returns the reading of the battery. `None` if the battery's
    /// converter has not converted since the last call, or if no reading of the reference has been taken for
    /// [`REFERENCE_STALE`].
    fn take(&mut self) -> Option<u16> {
        if let Some(vrefint) = K::take_reference(self.reference.0) {
            (self.vrefint, self.vrefint_at) = (vrefint, Some(Instant::now()));
        }
        let known = Instant::now().saturating_duration_since(self.vrefint_at?) <= REFERENCE_STALE;
        let (converter, _) = self.battery;
        // Reading clears the flag.
        (known && converter.isr().read().eoc()).then(|| converter.dr().read().rdata())
    }
}

impl<K: ConverterHal> Calibrate for TwoConverters<K> {
    /// Calibrates both converters, and starts them. A converter whose calibration does not end gives no readings.
    async fn calibrate(&self) {
        calibrate::<K>(&[self.battery.0, self.reference.0]).await;
        for (converter, channel) in self.converters() {
            K::connect(converter, channel);
        }
        let (converter, channel) = self.battery;
        converter.cfgr().modify(|w| {
            w.set_awd1sgl(Awd1sgl::SINGLE);
            w.set_awd1ch(channel);
            w.set_awd1en(true);
        });
        convert_without_end(converter, channel);
        self.hal.prepare_reference(self.reference.0, self.reference.1);
        for (converter, _) in self.converters() {
            start(converter);
        }
        unmask(K::INTERRUPT);
    }
}

/// Prepares a converter for conversions of one channel without end. The data register then holds the newest reading.
pub fn convert_without_end(converter: Adc, channel: u8) {
    converter.sqr1().write(|w| w.set_sq(0, channel));
    converter.cfgr().modify(|w| {
        w.set_cont(true);
        w.set_ovrmod(Ovrmod::OVERWRITE);
    });
}

/// Switches the regulator of a converter on.
pub fn power_up(converter: Adc) {
    converter.cr().modify(|w| {
        w.set_deeppwd(false);
        w.set_advregen(true);
    });
}

/// Calibrates and enables converters that have been powered up.
pub async fn calibrate<K: ConverterHal>(converters: &[Adc]) {
    // The regulators take 20 us (DS12288), or 10 us (DS12110), at most.
    Timer::after_micros(30).await;
    for converter in converters {
        K::prepare_calibration(*converter);
        converter.cr().modify(|w| w.set_adcal(true));
    }
    for _ in 0..K::CALIBRATION_MS {
        Timer::after_millis(1).await;
        if !converters.iter().any(|converter| converter.cr().read().adcal()) {
            break;
        }
    }
    // A converter may be enabled four cycles after its calibration (RM0440 21.4.9, RM0433 25.4.9).
    Timer::after_micros(1).await;
    for converter in converters {
        converter.cr().modify(|w| w.set_aden(true));
    }
    // A converter becomes ready in less than 20 us. A converter that does not become ready gives no readings, and is
    // restarted later.
    Timer::after_micros(20).await;
}

/// Starts a converter.
pub fn start(converter: Adc) {
    converter.cr().modify(|w| w.set_adstart(true));
}

/// Stops a running conversion. The stop takes a few cycles of the converter.
pub fn stop(converter: Adc) {
    if converter.cr().read().adstart() {
        converter.cr().modify(|w| w.set_adstp(Adstp::STOP));
        for _ in 0..STOP_READS {
            if !converter.cr().read().adstart() {
                break;
            }
        }
    }
}

/// Words that the data register's FIFO keeps on an STM32H7 (RM0433 25.4.27). Other chips keep one word.
const FIFO_WORDS: usize = 8;

/// Stops a converter and starts it again. Discards the readings of the stopped sequence, which would be taken for readings of
/// the new one. After an overrun the FIFO takes no reading until OVR is cleared (RM0433 25.4.27).
pub fn restart(converter: Adc) {
    stop(converter);
    for _ in 0..FIFO_WORDS {
        let _ = converter.dr().read();
    }
    converter.isr().write(|w| {
        w.set_eos(true);
        w.set_ovr(true);
    });
    start(converter);
}

impl<K: ConverterHal> SupplyAdc for TwoConverters<K> {
    async fn sample(&mut self) -> Option<Millivolts> {
        let mut battery = self.take();
        if battery.is_none() {
            Timer::after_micros(K::WAIT_MICROS).await;
            battery = self.take();
        }
        if battery.is_none() {
            // A converter has stopped, for example because of a disturbance of its supply.
            for (converter, _) in self.converters() {
                restart(converter);
            }
        }
        K::next_reference(self.reference.0);
        self.scale.battery(battery?, self.vrefint)
    }

    async fn wait_until_outside(&mut self, quiet: RangeInclusive<Millivolts>) {
        let reading = |voltage: &Millivolts| self.scale.reading(*voltage, self.vrefint);
        let (converter, _) = self.battery;
        // Thresholds may change only while the converter is stopped (RM0440 21.4.10, RM0433 25.4.10).
        stop(converter);
        K::limit(converter, reading(quiet.start()), reading(quiet.end()));
        converter.isr().write(|w| w.set_awd1(true));
        start(converter);
        let crossed = || converter.isr().read().awd1();
        WAITER.wait(crossed, || converter.ier().modify(|w| w.set_awd1ie(true))).await;
    }
}

/// Handles the interrupt of the battery's converter: wakes the task once. The flag of the interrupt stays set for the task.
pub fn handle_watchdog_interrupt(battery: Adc) {
    battery.ier().modify(|w| w.set_awd1ie(false));
    WAITER.wake();
}
