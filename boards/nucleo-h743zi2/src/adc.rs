//! Battery (PA3) on ADC1 and VREFINT on ADC3, which both convert for ever: newest values are always there to be read,
//! and ADC1's analog watchdog wakes the core when the battery leaves the voltages at which nobody needs to look.
//!
//! The HAL has neither, and would calibrate with the core waiting. VREFINT is on ADC3 alone (RM0433 table 209), PA3 is
//! not: so there is a data register for each, without DMA, and a converter that has stopped shows in a flag that does
//! not come again.

use core::future::poll_fn;
use core::ops::RangeInclusive;
use core::task::Poll;

use embassy_stm32::gpio::Flex;
use embassy_stm32::pac::adc::Adc;
use embassy_stm32::pac::adc::vals::{Adstp, Awd1sgl, Boost, Ovrmod, Pcsel, SampleTime};
use embassy_stm32::peripherals::{ADC1, ADC3, PA3};
use embassy_stm32::{Peri, interrupt, pac, rcc};
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::Timer;
use motor_hub::board::SupplyAdc;
use motor_hub::supply::{VrefintCalibration, VrefintSample, VrefintScale};
use motor_hub::units::{Millivolts, RangeError};

/// The converter of the battery, and ADC12_INP15, which is PA3 (STM32H743 data sheet, pin definitions).
const BATTERY: (Adc, u8) = (pac::ADC1, 15);
/// The converter of the reference, and ADC3_IN19, which is VREFINT (RM0433 table 209).
const VREFINT: (Adc, u8) = (pac::ADC3, 19);

/// A conversion of 810.5 + 8.5 cycles at 16 MHz takes 51 us.
const WAIT_MICROS: u64 = 110;

/// 165 010 cycles of a calibration with linearity (DS12110, ADC characteristics) take 10.3 ms; twice that and more.
const CALIBRATION_MS: u32 = 25;

/// Reads of a register after which a converter that has not stopped never will: some microseconds.
const STOP_READS: u32 = 200;

/// Who waits for the watchdog.
static WATCHER: AtomicWaker = AtomicWaker::new();

/// ADC1 with its battery pin, ADC3 with its reference.
pub(crate) struct BatteryAdc {
    scale: VrefintScale,
    /// The newest.
    vrefint: u16,
    _converters: (Peri<'static, ADC1>, Peri<'static, ADC3>),
    _pin: Flex<'static>,
}

impl BatteryAdc {
    /// Converts nothing before it is [calibrated](Self::calibrate); behind a divider of these resistances to the
    /// battery and to ground.
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance is 0.
    pub(crate) fn new(
        battery: Peri<'static, ADC1>,
        reference: Peri<'static, ADC3>,
        pin: Peri<'static, PA3>,
        (top_ohms, bottom_ohms): (u32, u32),
    ) -> Result<Self, RangeError> {
        let calibration = vrefint_calibration();
        let scale = VrefintScale::new(top_ohms, bottom_ohms, calibration)?;
        let mut pin = Flex::new(pin);
        pin.set_as_analog();
        rcc::enable_and_reset::<ADC1>();
        rcc::enable_and_reset::<ADC3>();
        // While all converters are disabled (RM0433 25.4.10).
        pac::ADC3_COMMON.ccr().modify(|w| w.set_vrefen(true));
        for (converter, _) in [BATTERY, VREFINT] {
            power_up(converter);
        }
        Ok(Self { scale, vrefint: calibration.reading, _converters: (battery, reference), _pin: pin })
    }

    /// Takes some 11 ms; converts from then on. Of a converter that does not come to an end nothing is heard.
    pub(crate) async fn calibrate(&self) {
        calibrate(&[BATTERY.0, VREFINT.0]).await;
        for (converter, channel) in [BATTERY, VREFINT] {
            set_up(converter, channel);
            start(converter);
        }
        unmask_watchdog();
    }
}

/// Switches the regulator of a converter on.
pub(crate) fn power_up(converter: Adc) {
    converter.cr().modify(|w| {
        w.set_boost(Boost::LT25);
        w.set_deeppwd(false);
        w.set_advregen(true);
    });
}

/// Calibrates converters that have been powered up, and enables them: ready for their first conversion.
pub(crate) async fn calibrate(converters: &[Adc]) {
    // The regulators take 10 us at most (DS12110).
    Timer::after_micros(20).await;
    for converter in converters {
        converter.cr().modify(|w| w.set_adcallin(true));
        converter.cr().modify(|w| w.set_adcal(true));
    }
    for _ in 0..CALIBRATION_MS {
        Timer::after_millis(1).await;
        if !converters.iter().any(|converter| converter.cr().read().adcal()) {
            break;
        }
    }
    // Four cycles and more after that (RM0433 25.4.9), and the same before the first conversion.
    Timer::after_micros(1).await;
    for converter in converters {
        converter.cr().modify(|w| w.set_aden(true));
    }
    Timer::after_micros(20).await;
}

/// One channel again and again, the newest word in the data register.
fn set_up(converter: Adc, channel: u8) {
    // The longest, 51 us: VREFINT needs 4.3 us (DS12110), and the divider's 8.9 kohm is a weak source.
    converter.smpr(1).modify(|w| w.set_smp(usize::from(channel) - 10, SampleTime::CYCLES810_5));
    converter.pcsel().modify(|w| w.set_pcsel(usize::from(channel), Pcsel::PRESELECTED));
    converter.sqr1().write(|w| w.set_sq(0, channel));
    converter.cfgr().modify(|w| {
        w.set_cont(true);
        w.set_ovrmod(Ovrmod::OVERWRITE);
        w.set_awd1sgl(Awd1sgl::SINGLE);
        w.set_awd1ch(channel);
        // The reference has nobody who waits for it.
        w.set_awd1en(channel == BATTERY.1);
    });
}

fn start(converter: Adc) {
    converter.cr().modify(|w| w.set_adstart(true));
}

/// Stops a conversion that goes on, which takes a few of the converter's cycles.
pub(crate) fn stop(converter: Adc) {
    if converter.cr().read().adstart() {
        converter.cr().modify(|w| w.set_adstp(Adstp::STOP));
        for _ in 0..STOP_READS {
            if !converter.cr().read().adstart() {
                break;
            }
        }
    }
}

/// True if battery and VREFINT have been converted since they were last read.
fn is_new() -> bool {
    [BATTERY, VREFINT].iter().all(|(converter, _)| converter.isr().read().eoc())
}

impl SupplyAdc for BatteryAdc {
    async fn sample(&mut self) -> Option<Millivolts> {
        if !is_new() {
            Timer::after_micros(WAIT_MICROS).await;
            if !is_new() {
                for (converter, _) in [BATTERY, VREFINT] {
                    stop(converter);
                    start(converter);
                }
                return None;
            }
        }
        // Reading clears the flags.
        self.vrefint = VREFINT.0.dr().read().rdata();
        self.scale.battery(VrefintSample { battery: BATTERY.0.dr().read().rdata(), vrefint: self.vrefint })
    }

    async fn leaves(&mut self, quiet: RangeInclusive<Millivolts>) {
        let reading = |voltage: &Millivolts| u32::from(self.scale.reading(*voltage, self.vrefint));
        let (converter, _) = BATTERY;
        // Thresholds are for a converter that does not convert (RM0433 25.4.10).
        stop(converter);
        converter.ltr1().write(|w| w.set_ltr1(reading(quiet.start())));
        converter.htr1().write(|w| w.set_htr1(reading(quiet.end())));
        converter.isr().write(|w| w.set_awd1(true));
        start(converter);
        poll_fn(|context| {
            WATCHER.register(context.waker());
            if converter.isr().read().awd1() {
                return Poll::Ready(());
            }
            converter.ier().modify(|w| w.set_awd1ie(true));
            Poll::Pending
        })
        .await;
    }
}

/// The flag stays for whoever waits; that it was raised is told once.
#[interrupt]
fn ADC() {
    BATTERY.0.ier().modify(|w| w.set_awd1ie(false));
    WATCHER.wake();
}

#[expect(
    unsafe_code,
    reason = "unmasking could break a critical section that masks a single interrupt; none does"
)]
fn unmask_watchdog() {
    // SAFETY: the handler touches nothing but a register and a waker made for interrupts.
    unsafe { cortex_m::peripheral::NVIC::unmask(pac::Interrupt::ADC) }
}

/// This chip's VREFINT reading at 3.3 V and 30 degrees with 16 bits, taken in the factory (DS12110, internal reference
/// voltage calibration values).
#[expect(unsafe_code, reason = "the peripheral access crate has no name for this word")]
fn vrefint_calibration() -> VrefintCalibration {
    const VREFIN_CAL: *const u16 = 0x1FF1_E860 as *const u16;
    // SAFETY: an aligned half-word of the chip's read-only system memory, always readable, and any bits
    // are a u16.
    let reading = unsafe { VREFIN_CAL.read_volatile() };
    VrefintCalibration { reading, rail: Millivolts::new(3_300), bits: 16 }
}
