//! Battery (PA3) and VREFINT as one injected pair of conversions on ADC1.
//!
//! The HAL has no asynchronous conversion for this converter. An injected group needs little: both
//! channels are converted in hardware one after the other into registers of their own, in a time that
//! is known, so the task sleeps for twice that time and then looks whether they are there. No
//! interrupt, no DMA, no busy waiting, and a converter that does not answer shows at once.

use embassy_stm32::Peri;
use embassy_stm32::adc::{Adc, SampleTime};
use embassy_stm32::gpio::Flex;
use embassy_stm32::pac;
use embassy_stm32::peripherals::{ADC1, PA3};
use embassy_time::Timer;
use motor_hub::board::SupplyAdc;
use motor_hub::supply::{VrefintCalibration, VrefintSample, VrefintScale};
use motor_hub::units::{Millivolts, RangeError};

/// ADC1_IN3 is PA3 (STM32F429 data sheet, pin definitions).
const BATTERY_CHANNEL: u8 = 3;
/// ADC1_IN17 is VREFINT (RM0090 13.10).
const VREFINT_CHANNEL: u8 = 17;

/// Two conversions of 480 + 12 cycles at 21 MHz (PCLK2 / 4) take 47 us.
const WAIT_MICROS: u64 = 100;

/// ADC1 with its battery pin.
pub(crate) struct BatteryAdc {
    scale: VrefintScale,
    _adc: Adc<'static, ADC1>,
    _pin: Flex<'static>,
}

impl BatteryAdc {
    /// Ready to convert, behind a divider of these resistances to the battery and to ground.
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance is 0.
    pub(crate) fn new(
        adc: Peri<'static, ADC1>,
        pin: Peri<'static, PA3>,
        (top_ohms, bottom_ohms): (u32, u32),
    ) -> Result<Self, RangeError> {
        let scale = VrefintScale::new(top_ohms, bottom_ohms, vrefint_calibration())?;
        let mut pin = Flex::new(pin);
        pin.set_as_analog();
        let adc = Adc::new(adc);
        adc.enable_vrefint();
        // The longest sampling time, 22.9 us: VREFINT needs 10 us (data sheet), and the divider's 8.2 kohm
        // is a weak source.
        let slow = SampleTime::CYCLES480;
        pac::ADC1.smpr2().modify(|w| w.set_smp(usize::from(BATTERY_CHANNEL), slow));
        pac::ADC1.smpr1().modify(|w| w.set_smp(usize::from(VREFINT_CHANNEL) - 10, slow));
        // A group of two is the last two of the four places (RM0090 13.13.12).
        pac::ADC1.jsqr().write(|w| {
            w.set_jl(1);
            w.set_jsq(2, BATTERY_CHANNEL);
            w.set_jsq(3, VREFINT_CHANNEL);
        });
        pac::ADC1.cr1().modify(|w| w.set_scan(true));
        Ok(Self { scale, _adc: adc, _pin: pin })
    }
}

impl SupplyAdc for BatteryAdc {
    async fn sample(&mut self) -> Option<Millivolts> {
        pac::ADC1.sr().modify(|w| {
            w.set_jeoc(false);
            w.set_jstrt(false);
        });
        pac::ADC1.cr2().modify(|w| w.set_jswstart(true));
        Timer::after_micros(WAIT_MICROS).await;
        if !pac::ADC1.sr().read().jeoc() {
            return None;
        }
        self.scale.battery(VrefintSample {
            battery: pac::ADC1.jdr(0).read().jdata(),
            vrefint: pac::ADC1.jdr(1).read().jdata(),
        })
    }
}

/// This chip's VREFINT reading at 3.3 V and 30 degrees with 12 bits, taken in the factory (STM32F429 data
/// sheet, internal reference voltage calibration values).
#[expect(unsafe_code, reason = "the peripheral access crate has no name for this word")]
fn vrefint_calibration() -> VrefintCalibration {
    const VREFIN_CAL: *const u16 = 0x1FFF_7A2A as *const u16;
    // SAFETY: an aligned half-word of the chip's read-only system memory, always readable, and any bits
    // are a u16.
    let reading = unsafe { VREFIN_CAL.read_volatile() };
    VrefintCalibration { reading, rail: Millivolts::new(3_300), bits: 12 }
}
