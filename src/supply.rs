//! Battery voltage: from ADC readings and the chip's own reference to filtered millivolts.
//!
//! The internal reference VREFINT is read beside the battery. Its factory calibration tells what the
//! ADC's supply really is, so that a sagging 3.3 V rail does not pass for a rising battery.

use crate::units::{Micros, Millivolts, RangeError};

/// Largest reading of a 12-bit converter.
const FULL_SCALE: i64 = 4095;

/// The rail at which VREFINT is calibrated in the factory (STM32F4 data sheets).
const CALIBRATION_RAIL_MV: i64 = 3300;

/// The rails that an STM32F4 can run from; a VREFINT reading that says otherwise is a bad reading.
const RAIL_MV: core::ops::RangeInclusive<i64> = 1700..=3700;

/// A battery reading older than this is none: ten sampling intervals.
pub const STALE_MICROS: u64 = 100_000;

/// One pair of conversions, right-aligned, 12 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sample {
    /// The divided battery voltage.
    pub battery: u16,
    /// The internal reference.
    pub vrefint: u16,
}

/// How the battery reaches the converter, and what the chip's reference is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    vrefint_calibration: u16,
    /// Battery over pin voltage, in steps of 2^-10.
    ratio: i64,
}

impl Scale {
    /// A divider of `top_ohms` to the battery and `bottom_ohms` to ground, and the chip's VREFINT
    /// reading at 3.3 V (F42x: the half-word at 0x1FFF_7A2A).
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance is 0.
    pub const fn new(top_ohms: u32, bottom_ohms: u32, vrefint_calibration: u16) -> Result<Self, RangeError> {
        if top_ohms == 0 || bottom_ohms == 0 {
            return Err(RangeError::Divider);
        }
        let ratio = ((top_ohms as i64 + bottom_ohms as i64) << 10) / bottom_ohms as i64;
        Ok(Self { vrefint_calibration, ratio })
    }

    /// `None` if the reference reads as no rail that the chip could run from.
    fn battery_mv(self, sample: Sample) -> Option<i64> {
        let reference = i64::from(sample.vrefint.min(FULL_SCALE as u16));
        if reference == 0 {
            return None;
        }
        let at_calibration = CALIBRATION_RAIL_MV * i64::from(self.vrefint_calibration);
        if !RAIL_MV.contains(&(at_calibration / reference)) {
            return None;
        }
        // 12 + 12 + 12 + at most 42 bits would not do for absurd dividers; saturating says "too high".
        let pin = i64::from(sample.battery.min(FULL_SCALE as u16)) * at_calibration;
        Some((pin.saturating_mul(self.ratio) / (FULL_SCALE * reference)) >> 10)
    }
}

/// What a battery can be; readings outside are implausible.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Lowest plausible voltage.
    pub min: Millivolts,
    /// Highest plausible voltage.
    pub max: Millivolts,
}

impl Default for Limits {
    /// 5 to 18 V: a 12 V battery, from sagging to on its charger.
    fn default() -> Self {
        Self { min: Millivolts::new(5_000), max: Millivolts::new(18_000) }
    }
}

/// A filtered voltage and when it was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Battery {
    /// Filtered.
    pub voltage: Millivolts,
    /// When the newest sample in it was taken.
    pub at: Micros,
}

impl Battery {
    /// The voltage, unless it is older than [`STALE_MICROS`].
    pub const fn fresh(self, now: Micros) -> Option<Millivolts> {
        if now.since(self.at) <= STALE_MICROS { Some(self.voltage) } else { None }
    }
}

/// Converts and filters.
#[derive(Clone, Debug)]
pub struct Supply {
    scale: Scale,
    limits: Limits,
    /// Filter state in steps of 2^-8 mV; `None` before the first good reading and after a bad one.
    filtered: Option<i64>,
}

impl Supply {
    /// Knows no voltage yet.
    pub const fn new(scale: Scale, limits: Limits) -> Self {
        Self { scale, limits, filtered: None }
    }

    /// Takes a sample; `None` if it is implausible. The sample after an implausible one starts the
    /// filter afresh.
    ///
    /// The filter is of first order with a time constant of four samples.
    pub fn step(&mut self, sample: Sample, now: Micros) -> Option<Battery> {
        let range = i64::from(self.limits.min.get())..=i64::from(self.limits.max.get());
        let mv = self.scale.battery_mv(sample).filter(|mv| range.contains(mv));
        self.filtered = mv.map(|mv| match self.filtered {
            None => mv << 8,
            Some(old) => old + ((mv << 8) - old) / 4,
        });
        let filtered = self.filtered?;
        // Within the limits like everything it is made of, hence within 16 bits.
        let voltage = Millivolts::new(u16::try_from((filtered + 128) >> 8).unwrap_or(u16::MAX));
        Some(Battery { voltage, at: now })
    }
}
