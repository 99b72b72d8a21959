//! Readings of a converter to millivolts, with a chip's internal reference VREFINT read beside the battery.

use crate::units::{Millivolts, RangeError};

/// The rails that an STM32 can run from; a VREFINT reading that says otherwise is a bad reading.
const RAIL_MV: core::ops::RangeInclusive<i64> = 1700..=3700;

/// One pair of conversions, right-aligned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct VrefintSample {
    /// The divided battery voltage.
    pub battery: u16,
    /// The internal reference.
    pub vrefint: u16,
}

/// What the factory found out about a chip's internal reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VrefintCalibration {
    /// The reference as the converter read it.
    pub reading: u16,
    /// The converter's supply at that time: 3.3 V in an STM32F4, 3.0 V in a G4 (data sheets).
    pub rail: Millivolts,
    /// The converter's resolution in bits, then and now: 1 to 16.
    pub bits: u8,
}

/// From readings to the battery's voltage, with a chip's internal reference VREFINT read beside the
/// battery. Its calibration tells what the converter's supply really is, so that a sagging rail does not
/// pass for a rising battery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VrefintScale {
    calibration: VrefintCalibration,
    /// Battery over pin voltage, in steps of 2^-10.
    ratio: i64,
    /// Counts of the battery's reading for each millivolt and each count of the reference's, in steps of 2^-36.
    per_millivolt: i64,
}

impl VrefintScale {
    /// A divider of `top_ohms` to the battery and `bottom_ohms` to ground.
    ///
    /// # Errors
    /// [`RangeError::Divider`] if a resistance is 0, [`RangeError::Resolution`] of a converter without 1 to
    /// 16 bits.
    pub const fn new(
        top_ohms: u32,
        bottom_ohms: u32,
        calibration: VrefintCalibration,
    ) -> Result<Self, RangeError> {
        if top_ohms == 0 || bottom_ohms == 0 {
            return Err(RangeError::Divider);
        }
        if calibration.bits == 0 || calibration.bits > 16 {
            return Err(RangeError::Resolution);
        }
        let ratio = ((top_ohms as i64 + bottom_ohms as i64) << 10) / bottom_ohms as i64;
        let full_scale = (1 << calibration.bits) - 1;
        let at_calibration = calibration.rail.get() as i64 * calibration.reading as i64;
        let whole = at_calibration.saturating_mul(ratio);
        let per_millivolt = if whole == 0 { i64::MAX } else { (full_scale << 46) / whole };
        Ok(Self { calibration, ratio, per_millivolt })
    }

    /// The battery's voltage; `None` if the reference reads as no rail that the chip could run from, or
    /// beyond 65.535 V.
    pub fn battery(self, sample: VrefintSample) -> Option<Millivolts> {
        let full_scale = (1_i64 << self.calibration.bits) - 1;
        let reference = i64::from(sample.vrefint).min(full_scale);
        if reference == 0 {
            return None;
        }
        let at_calibration = i64::from(self.calibration.rail.get()) * i64::from(self.calibration.reading);
        if !RAIL_MV.contains(&(at_calibration / reference)) {
            return None;
        }
        // 16 + 16 + 16 + at most 42 bits would not do for absurd dividers; saturating says "too high".
        let pin = i64::from(sample.battery).min(full_scale) * at_calibration;
        let mv = (pin.saturating_mul(self.ratio) / (full_scale * reference)) >> 10;
        u16::try_from(mv).ok().map(Millivolts::new)
    }

    /// How the converter would read a battery's voltage while it reads its reference so; at most its full scale.
    pub fn reading(self, battery: Millivolts, vrefint: u16) -> u16 {
        let full_scale = (1_i64 << self.calibration.bits) - 1;
        let at_one = i64::from(battery.get()) * i64::from(vrefint);
        u16::try_from((at_one.saturating_mul(self.per_millivolt) >> 36).min(full_scale)).unwrap_or(u16::MAX)
    }
}
