//! Battery and VREFINT on a converter each, as the STM32G4 and the STM32H7 have them.
//!
//! Both converters convert without end, so the newest readings can always be read. The analog watchdog of the battery's
//! converter wakes the core when the battery leaves its quiet range.
//!
//! The HAL has neither of these, and its calibration blocks the core. Each converter has a data register, so there is no
//! DMA. A converter that has stopped raises no new flag, which shows.

use crate::Calibrate;
use crate::supply::{FactoryWord, Watcher, unmask};
use core::marker::PhantomData;
use core::ops::RangeInclusive;
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac::Interrupt;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::{Adstp, Awd1sgl, Ovrmod};
use embassy_time::Timer;
use motor_hub::board::SupplyAdc;
use motor_hub::supply::{VrefintSample, VrefintScale};
use motor_hub::units::{Millivolts, RangeError};

/// Number of reads of a register, some microseconds, after which a converter that has not stopped never stops.
const STOP_READS: u32 = 200;

static WATCHER: Watcher = Watcher::new();

/// What differs between the converters of two chips.
pub trait Kind {
    /// Interrupt of the battery's converter.
    const INTERRUPT: Interrupt;
    /// Time in which both converters end a conversion, in microseconds.
    const WAIT_MICROS: u64;
    /// Longest time of a calibration, in milliseconds.
    const CALIBRATION_MS: u32;

    /// Chooses the mode of a calibration.
    fn prepare_calibration(converter: Adc);

    /// Connects a channel to a converter, with the longest sampling time.
    fn connect(converter: Adc, channel: u8);

    /// Sets the readings at which the analog watchdog triggers.
    fn limit(converter: Adc, low: u16, high: u16);
}

/// The two converters, with the battery's pin.
pub struct TwoConverters<K> {
    scale: VrefintScale,
    /// Newest reading of VREFINT.
    vrefint: u16,
    /// Converter and channel of the battery.
    battery: (Adc, u8),
    /// Converter and channel of VREFINT.
    reference: (Adc, u8),
    _pin: Flex<'static>,
    _kind: PhantomData<K>,
}

impl<K: Kind> TwoConverters<K> {
    /// Takes converters that have their clock and are disabled. They convert nothing before their calibration.
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance of the divider, to the battery or to ground, is 0.
    pub fn new(
        battery: (Adc, u8),
        reference: (Adc, u8),
        mut pin: Flex<'static>,
        word: FactoryWord,
        (top_ohms, bottom_ohms): (u32, u32),
    ) -> Result<Self, RangeError> {
        let calibration = word.read();
        let scale = VrefintScale::new(top_ohms, bottom_ohms, calibration)?;
        pin.set_as_analog();
        for (converter, _) in [battery, reference] {
            power_up(converter);
        }
        let vrefint = calibration.reading;
        Ok(Self { scale, vrefint, battery, reference, _pin: pin, _kind: PhantomData })
    }

    fn converters(&self) -> [(Adc, u8); 2] {
        [self.battery, self.reference]
    }

    /// True if both channels have been converted since they were last read.
    fn is_new(&self) -> bool {
        self.converters().iter().all(|(converter, _)| converter.isr().read().eoc())
    }
}

impl<K: Kind> Calibrate for TwoConverters<K> {
    /// Calibrates both converters, and starts them. A converter whose calibration does not end gives no readings.
    async fn calibrate(&self) {
        calibrate::<K>(&[self.battery.0, self.reference.0]).await;
        for (converter, channel) in self.converters() {
            K::connect(converter, channel);
            converter.sqr1().write(|w| w.set_sq(0, channel));
            converter.cfgr().modify(|w| {
                w.set_cont(true);
                w.set_ovrmod(Ovrmod::OVERWRITE);
                w.set_awd1sgl(Awd1sgl::SINGLE);
                w.set_awd1ch(channel);
                // Nothing waits for a change of VREFINT.
                w.set_awd1en(converter == self.battery.0);
            });
            start(converter);
        }
        unmask(K::INTERRUPT);
    }
}

/// Switches the regulator of a converter on.
pub fn power_up(converter: Adc) {
    converter.cr().modify(|w| {
        w.set_deeppwd(false);
        w.set_advregen(true);
    });
}

/// Calibrates and enables converters that have been powered up.
pub async fn calibrate<K: Kind>(converters: &[Adc]) {
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
    // At least four cycles after the calibration (RM0440 21.4.9, RM0433 25.4.9), and before the first conversion.
    Timer::after_micros(1).await;
    for converter in converters {
        converter.cr().modify(|w| w.set_aden(true));
    }
    Timer::after_micros(20).await;
}

fn start(converter: Adc) {
    converter.cr().modify(|w| w.set_adstart(true));
}

/// Stops a running conversion, which takes a few cycles of the converter.
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

impl<K: Kind> SupplyAdc for TwoConverters<K> {
    async fn sample(&mut self) -> Option<Millivolts> {
        if !self.is_new() {
            Timer::after_micros(K::WAIT_MICROS).await;
            if !self.is_new() {
                for (converter, _) in self.converters() {
                    stop(converter);
                    start(converter);
                }
                return None;
            }
        }
        // Reading clears the flags.
        let [vrefint, battery] = [self.reference, self.battery].map(|(adc, _)| adc.dr().read().rdata());
        self.vrefint = vrefint;
        self.scale.battery(VrefintSample { battery, vrefint })
    }

    async fn leaves(&mut self, quiet: RangeInclusive<Millivolts>) {
        let reading = |voltage: &Millivolts| self.scale.reading(*voltage, self.vrefint);
        let (converter, _) = self.battery;
        // Thresholds may change only while the converter is stopped (RM0440 21.4.10, RM0433 25.4.10).
        stop(converter);
        K::limit(converter, reading(quiet.start()), reading(quiet.end()));
        converter.isr().write(|w| w.set_awd1(true));
        start(converter);
        let crossed = || converter.isr().read().awd1();
        WATCHER.wait(crossed, || converter.ier().modify(|w| w.set_awd1ie(true))).await;
    }
}

/// Handles the interrupt of the battery's converter. The flag stays raised for the task, which is woken once.
pub fn crossed(battery: Adc) {
    battery.ier().modify(|w| w.set_awd1ie(false));
    WATCHER.wake();
}
