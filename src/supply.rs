//! Battery voltage: what a board's converter measured, as filtered millivolts while it is plausible.
//!
//! Boards whose chip reads its own reference beside the battery have [`VrefintScale`] for the first step;
//! others bring millivolts of their own.
//!
//! ```
//! use motor_hub::supply::{Limits, Supply};
//! use motor_hub::units::{Micros, Millivolts};
//!
//! let mut supply = Supply::new(Limits::default());
//! let battery = supply.step(Some(Millivolts::new(12_000)), Micros::new(10_000)).expect("plausible");
//! assert_eq!(battery.voltage, Millivolts::new(12_000));
//! assert_eq!(supply.step(Some(Millivolts::new(3_000)), Micros::new(20_000)), None);
//! ```

use crate::units::{Micros, Millivolts, RangeError};

/// A battery reading older than this is none: ten sampling intervals.
pub const BATTERY_STALE_MICROS: u64 = 100_000;

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
        Ok(Self { calibration, ratio })
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
    /// The voltage, unless it is older than [`BATTERY_STALE_MICROS`].
    pub const fn fresh(self, now: Micros) -> Option<Millivolts> {
        if now.since(self.at) <= BATTERY_STALE_MICROS { Some(self.voltage) } else { None }
    }
}

/// Judges and filters.
#[derive(Clone, Debug)]
pub struct Supply {
    limits: Limits,
    /// Filter state in steps of 2^-8 mV; `None` before the first good reading and after a bad one.
    filtered: Option<i64>,
}

impl Supply {
    /// Knows no voltage yet.
    pub const fn new(limits: Limits) -> Self {
        Self { limits, filtered: None }
    }

    /// Takes a measured voltage; `None` if there is none or it is implausible. The one after that starts
    /// the filter afresh.
    ///
    /// The filter is of first order with a time constant of four samples.
    pub fn step(&mut self, voltage: Option<Millivolts>, now: Micros) -> Option<Battery> {
        let plausible = self.limits.min..=self.limits.max;
        self.filtered = voltage.filter(|voltage| plausible.contains(voltage)).map(|voltage| {
            let new = i64::from(voltage.get()) << 8;
            self.filtered.map_or(new, |old| old + (new - old) / 4)
        });
        let filtered = self.filtered?;
        // Within the limits like everything it is made of, hence within 16 bits.
        let voltage = Millivolts::new(u16::try_from((filtered + 128) >> 8).unwrap_or(u16::MAX));
        Some(Battery { voltage, at: now })
    }
}
