//! Converts ADC readings to the battery's voltage and to the chip's temperature. Each conversion uses a reading of the
//! chip's internal reference, VREFINT.
//!
//! An ADC measures relative to its own supply, the *rail*. The reference has a known voltage, so the voltage of the
//! rail follows from the reading of the reference. Without this correction a falling rail would look like a rising
//! battery voltage.

use crate::units::{Millivolts, RangeError};

/// Rail voltages in mV that an STM32 can run from. The data sheets say 1.7 to 3.6 V; the upper end has a margin of 0.1
/// V. A VREFINT reading that means another rail voltage is invalid.
const RAIL_MV: core::ops::RangeInclusive<i64> = 1700..=3700;

/// Factory calibration of a chip's internal reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VrefintCalibration {
    /// Reading of the reference at calibration.
    pub reading: u16,
    /// Rail at calibration: 3.3 V for an STM32F4 or STM32H7, 3.0 V for an STM32G4 (data sheets).
    pub rail: Millivolts,
    /// Resolution of the converter in bits, 1 to 16, for the calibration and for all samples.
    pub bits: u8,
}

/// Temperatures at which the factory reads the temperature sensor, in 0.1 degrees Celsius (DS9405, DS12110, temperature
/// sensor calibration values).
const CALIBRATED_DECIDEGREES: [i64; 2] = [300, 1100];

impl VrefintCalibration {
    /// Returns the temperature of the chip in 0.1 degrees Celsius, from readings of the temperature sensor and of the
    /// reference. The sensor's voltage is linear in the temperature. `factory` are its readings at 30 and at 110 degrees
    /// Celsius, with the rail at calibration.
    ///
    /// `None` if both readings of the factory are equal, if `vrefint` is 0, or if the result is not within +-3000
    /// degrees.
    ///
    /// ```
    /// use motor_hub::supply::VrefintCalibration;
    /// use motor_hub::units::Millivolts;
    ///
    /// let reference = VrefintCalibration { reading: 1500, rail: Millivolts::new(3_300), bits: 12 };
    /// assert_eq!(reference.decidegrees([960, 1200], 960, 1500), Some(300));
    /// // The rail is 3.0 V: both readings are higher by a tenth.
    /// assert_eq!(reference.decidegrees([960, 1200], 1188, 1650), Some(700));
    /// ```
    pub fn decidegrees(self, factory: [u16; 2], sensor: u16, vrefint: u16) -> Option<i16> {
        let [low, high] = factory.map(i64::from);
        let [cold, hot] = CALIBRATED_DECIDEGREES;
        // The reading that the sensor would have with the rail at which it was calibrated.
        let reading = (i64::from(sensor) * i64::from(self.reading)).checked_div(i64::from(vrefint))?;
        let above = ((reading - low) * (hot - cold)).checked_div(high - low)?;
        i16::try_from(cold + above).ok().filter(|temperature| temperature.unsigned_abs() < 30_000)
    }
}

/// Converts pairs of readings to the battery's voltage, and back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VrefintScale {
    calibration: VrefintCalibration,
    /// Battery voltage divided by pin voltage, in steps of 2^-10.
    ratio: i64,
    /// Reading of the battery's voltage divider per millivolt of the battery and per unit of the reference's reading,
    /// in steps of 2^-36.
    counts_per_mv: i64,
}

impl VrefintScale {
    /// Creates the scale of a voltage divider with `top_ohms` to the battery and `bottom_ohms` to ground.
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance is 0. [`RangeError::Resolution`] if the converter does not have 1 to 16
    /// bits.
    pub const fn new(
        top_ohms: u32,
        bottom_ohms: u32,
        calibration: VrefintCalibration,
    ) -> Result<Self, RangeError> {
        if top_ohms == 0 || bottom_ohms == 0 {
            return Err(RangeError::Divider);
        }
        Self::with_ratio(((top_ohms as i64 + bottom_ohms as i64) << 10) / bottom_ohms as i64, calibration)
    }

    /// Creates the scale of a pin without a divider: the voltage is the pin's.
    ///
    /// # Errors
    /// [`RangeError::Resolution`] if the converter does not have 1 to 16 bits.
    pub const fn at_pin(calibration: VrefintCalibration) -> Result<Self, RangeError> {
        Self::with_ratio(1 << 10, calibration)
    }

    const fn with_ratio(ratio: i64, calibration: VrefintCalibration) -> Result<Self, RangeError> {
        if calibration.bits == 0 || calibration.bits > 16 {
            return Err(RangeError::Resolution);
        }
        let full_scale = (1 << calibration.bits) - 1;
        let calibration_product = calibration.rail.get() as i64 * calibration.reading as i64;
        let whole = calibration_product.saturating_mul(ratio);
        let counts_per_mv = if whole == 0 { i64::MAX } else { (full_scale << 46) / whole };
        Ok(Self { calibration, ratio, counts_per_mv })
    }

    /// Returns the battery's voltage from the readings of the voltage divider and of the internal reference, both
    /// right-aligned. `None` if the reading of the reference is 0 or means a rail that the chip cannot
    /// run from, or if the battery's voltage exceeds 65.535 V.
    pub fn battery(self, divider: u16, vrefint: u16) -> Option<Millivolts> {
        let full_scale = (1_i64 << self.calibration.bits) - 1;
        let reference = i64::from(vrefint).min(full_scale);
        if reference == 0 {
            return None;
        }
        let calibration_product =
            i64::from(self.calibration.rail.get()) * i64::from(self.calibration.reading);
        if !RAIL_MV.contains(&(calibration_product / reference)) {
            return None;
        }
        // The product of three 16-bit factors and a ratio of up to 42 bits can exceed 64 bits. A saturated product
        // means a voltage above 65.535 V, which is refused.
        let pin = i64::from(divider).min(full_scale) * calibration_product;
        let mv = (pin.saturating_mul(self.ratio) / (full_scale * reference)) >> 10;
        u16::try_from(mv).ok().map(Millivolts::new)
    }

    /// Returns the battery reading for a battery voltage and a reading `vrefint` of the reference. The result is at
    /// most full scale.
    pub fn reading(self, battery: Millivolts, vrefint: u16) -> u16 {
        let full_scale = (1_i64 << self.calibration.bits) - 1;
        let product = i64::from(battery.get()) * i64::from(vrefint);
        u16::try_from((product.saturating_mul(self.counts_per_mv) >> 36).min(full_scale)).unwrap_or(u16::MAX)
    }
}
