//! Electrical quantities: voltage, current, energy, and the constants of a winding.

use super::{CountsPerSecond, RangeError, nearest};
use core::num::NonZeroU16;
use fixed::types::{I12F20, I44F20};

/// Rounds to the nearest whole number. `None` if the result is not 1 to 65 535.
const fn nearest_u16(value: f64) -> Option<NonZeroU16> {
    match nearest(value) {
        Some(whole) if 0 < whole && whole <= u16::MAX as i64 => NonZeroU16::new(whole as u16),
        _ => None,
    }
}

/// A battery voltage, 0 to 65 535 mV.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Millivolts(u16);

impl Millivolts {
    /// Creates a voltage from whole millivolts.
    pub const fn new(mv: u16) -> Self {
        Self(mv)
    }

    /// Converts volts, rounded to the nearest millivolt.
    ///
    /// # Errors
    /// Returns [`RangeError::Voltage`] if the voltage is not 0 to 65.535 V.
    pub const fn from_volts(volts: f64) -> Result<Self, RangeError> {
        match nearest(1e3 * volts) {
            Some(mv) if 0 <= mv && mv <= u16::MAX as i64 => Ok(Self(mv as u16)),
            _ => Err(RangeError::Voltage),
        }
    }

    /// Returns the voltage in millivolts, 0 to 65 535.
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Returns the voltage in volts, rounded to the nearest `f32`.
    pub const fn to_volts(self) -> f32 {
        self.0 as f32 / 1000.0
    }
}

/// An energy: 0 to 1.8e13 J, in steps of 1 uJ. Sums beyond the range are limited to the range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Microjoules(u64);

impl Microjoules {
    /// The energy 0.
    pub const ZERO: Self = Self(0);

    /// Returns the energy increased by `microjoules`.
    #[must_use]
    pub const fn plus(self, microjoules: u32) -> Self {
        Self(self.0.saturating_add(microjoules as u64))
    }

    /// Returns the energy in microjoules.
    pub const fn get(self) -> u64 {
        self.0
    }
}

/// Resistance of a winding: 1 to 65 535 milliohms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Resistance(NonZeroU16);

impl Resistance {
    /// Creates a resistance from whole milliohms.
    ///
    /// # Errors
    /// Returns [`RangeError::Resistance`] if `mohm` is 0.
    pub const fn from_milliohms(mohm: u16) -> Result<Self, RangeError> {
        match NonZeroU16::new(mohm) {
            Some(mohm) => Ok(Self(mohm)),
            None => Err(RangeError::Resistance),
        }
    }

    /// Converts ohms, rounded to the nearest milliohm.
    ///
    /// # Errors
    /// Returns [`RangeError::Resistance`] if the result is not 1 to 65 535 milliohms.
    pub const fn from_ohms(ohms: f64) -> Result<Self, RangeError> {
        match nearest_u16(1e3 * ohms) {
            Some(mohm) => Ok(Self(mohm)),
            None => Err(RangeError::Resistance),
        }
    }

    /// Returns the resistance in milliohms, 1 to 65 535.
    pub const fn as_milliohms(self) -> u16 {
        self.0.get()
    }
}

logged!(Resistance, "{} mohm", as_milliohms);

/// Inductance of a winding: 1 to 65 535 microhenries. An unknown inductance is the `None` of an `Option<Inductance>`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Inductance(NonZeroU16);

impl Inductance {
    /// Creates an inductance from whole microhenries.
    ///
    /// # Errors
    /// Returns [`RangeError::Inductance`] if `uh` is 0.
    pub const fn from_microhenries(uh: u16) -> Result<Self, RangeError> {
        match NonZeroU16::new(uh) {
            Some(uh) => Ok(Self(uh)),
            None => Err(RangeError::Inductance),
        }
    }

    /// Converts millihenries, rounded to the nearest microhenry.
    ///
    /// # Errors
    /// Returns [`RangeError::Inductance`] if the result is not 1 to 65 535 microhenries.
    pub const fn from_millihenries(mh: f64) -> Result<Self, RangeError> {
        match nearest_u16(1e3 * mh) {
            Some(uh) => Ok(Self(uh)),
            None => Err(RangeError::Inductance),
        }
    }

    /// Returns the inductance in microhenries, 1 to 65 535.
    pub const fn as_microhenries(self) -> u16 {
        self.0.get()
    }
}

logged!(Inductance, "{} uH", as_microhenries);

/// Back-EMF constant keFw in mV s/count (millivolts per count per second).
///
/// The range is above 0 and below 32 mV s/count, in steps of 2^-20. This format is called 6q20 in R. Atkinson, *On
/// Proportional Braking in H Bridges* (revision of 31 August 2018). The largest constant in the catalogue of motors is
/// 18.72 mV s/count.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EmfConstant(I12F20);

impl EmfConstant {
    /// Computes keFw = 2000 pi Ke / counts, rounded to the nearest step.
    ///
    /// Ke is the motor's back-EMF constant in V s/rad, counts are the encoder's counts per revolution of the same
    /// shaft.
    ///
    /// ```
    /// # use motor_hub::units::{EmfConstant, constant};
    /// // AndyMark NeveRest 60; the encoder sits on the motor's own shaft.
    /// const NEVEREST_60: EmfConstant = constant!(EmfConstant::from_ke(0.017_766_667, 28.0));
    /// assert_eq!(NEVEREST_60.to_bits(), 4_180_495); // 3.98683 mV s/count
    /// ```
    ///
    /// # Errors
    /// Returns [`RangeError::EmfConstant`] if an argument is not above 0 or keFw is out of range.
    pub const fn from_ke(
        volt_seconds_per_radian: f64,
        counts_per_revolution: f64,
    ) -> Result<Self, RangeError> {
        let revolution = 2.0 * core::f64::consts::PI;
        let ke_fw = 1e3 * revolution * volt_seconds_per_radian / counts_per_revolution;
        match nearest(ke_fw * (1 << 20) as f64) {
            Some(bits) if counts_per_revolution > 0.0 && 0 < bits && bits <= i32::MAX as i64 => {
                Self::from_bits(bits as i32)
            }
            _ => Err(RangeError::EmfConstant),
        }
    }

    /// Creates the constant from its 6q20 bits, 1 to 2^25 - 1.
    ///
    /// # Errors
    /// Returns [`RangeError::EmfConstant`] if `bits` is out of that range.
    pub const fn from_bits(bits: i32) -> Result<Self, RangeError> {
        if bits > 0 && bits < 1 << 25 {
            Ok(Self(I12F20::from_bits(bits)))
        } else {
            Err(RangeError::EmfConstant)
        }
    }

    /// Returns the 6q20 bits.
    pub const fn to_bits(self) -> i32 {
        self.0.to_bits()
    }

    /// Returns the constant in V s/count, rounded to the nearest `f32`.
    pub const fn to_volts(self) -> f32 {
        self.to_bits() as f32 / (1e3 * (1 << 20) as f32)
    }

    /// Returns the constant in mV s/count, exactly.
    pub const fn to_millivolt_seconds(self) -> f64 {
        self.to_bits() as f64 / (1 << 20) as f64
    }

    /// Returns the back EMF at `speed`.
    ///
    /// The product has 64 bits. For a NeveRest 60 a product of 32 bits would overflow above 2 counts/s. With speeds in
    /// whole counts/s it would overflow above 513 counts/s.
    pub const fn emf(self, speed: CountsPerSecond) -> Emf {
        let bits = self.emf_bits(speed);
        let bits = if bits > Emf::MAX {
            Emf::MAX
        } else if bits < -Emf::MAX {
            -Emf::MAX
        } else {
            bits
        };
        Emf(I44F20::from_bits(bits))
    }

    /// Returns the back EMF at `speed`, and refuses what [`emf`](Self::emf) limits.
    ///
    /// # Errors
    /// Returns [`RangeError::Emf`] if the back EMF is not -131.071 to 131.071 V.
    pub const fn emf_within_range(self, speed: CountsPerSecond) -> Result<Emf, RangeError> {
        let bits = self.emf_bits(speed);
        if bits > Emf::MAX || bits < -Emf::MAX {
            return Err(RangeError::Emf);
        }
        Ok(Emf(I44F20::from_bits(bits)))
    }

    /// Back EMF at `speed` in steps of 2^-20 mV, without a limit: below 2^48.
    const fn emf_bits(self, speed: CountsPerSecond) -> i64 {
        // The product has steps of 2^-28 mV. Its magnitude is below 2^56.
        let product = speed.to_bits() as i64 * self.to_bits() as i64;
        (product + (1 << 7)) >> 8
    }
}

logged!(EmfConstant, "{}/2^20 mV s/count", to_bits);

/// A back EMF in steps of 2^-20 mV, positive when the motor turns CW.
///
/// Values beyond +-131 071 mV, far above any battery, are limited to that range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Emf(I44F20);

impl Emf {
    /// The largest magnitude, in steps of 2^-20 mV.
    const MAX: i64 = 131_071 << 20;

    /// Returns the back EMF in steps of 2^-20 mV.
    pub const fn to_bits(self) -> i64 {
        self.0.to_bits()
    }

    /// Returns the back EMF in volts, with a resolution of 1/16 mV, as `f32`.
    pub const fn to_volts(self) -> f32 {
        (self.to_bits() >> 16) as i32 as f32 / 16_000.0
    }

    /// Returns the back EMF in millivolts, for reports.
    pub fn to_f64(self) -> f64 {
        self.0.to_num()
    }
}

/// The average voltage across a motor: back EMF plus mean current times resistance.
///
/// A constant voltage of this value gives the same mean current as the switching bridge. Positive is CW. The range is
/// +-134 217 V, in steps of 1/16 mV.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Voltage(i32);

impl Voltage {
    /// The voltage 0.
    pub const ZERO: Self = Self(0);

    /// Converts volts, rounded towards 0. Values beyond the range are limited; NaN becomes 0.
    pub const fn from_volts(volts: f32) -> Self {
        let bits = (volts * 16_000.0) as i32;
        // The range is symmetric: its lower end is -i32::MAX.
        Self(if bits == i32::MIN { -i32::MAX } else { bits })
    }

    /// Returns the voltage in steps of 1/16 mV.
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    /// Returns the voltage in whole millivolts, rounded towards 0 and limited to -32 768 to 32 767.
    pub const fn to_millivolts(self) -> i16 {
        let millivolts = self.0 / 16;
        if millivolts > i16::MAX as i32 {
            i16::MAX
        } else if millivolts < i16::MIN as i32 {
            i16::MIN
        } else {
            millivolts as i16
        }
    }

    /// Returns the voltage in volts, rounded to the nearest `f32`.
    pub const fn to_volts(self) -> f32 {
        self.0 as f32 / 16_000.0
    }
}

logged!(Voltage, "{} mV", to_millivolts);

/// A current in milliamperes: +-2 147 483 A.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Milliamperes(i32);

impl Milliamperes {
    /// The current 0.
    pub const ZERO: Self = Self(0);

    /// Creates a current from whole milliamperes.
    pub const fn new(milliamperes: i32) -> Self {
        Self(milliamperes)
    }

    /// Returns the current in amperes, rounded to the nearest `f32`.
    pub const fn to_amperes(self) -> f32 {
        self.0 as f32 / 1000.0
    }

    /// Converts amperes, rounded towards 0. Values beyond the range are limited; NaN becomes 0.
    pub const fn from_amperes(amperes: f32) -> Self {
        Self((1000.0 * amperes) as i32)
    }

    /// Returns the current in milliamperes.
    pub const fn get(self) -> i32 {
        self.0
    }

    /// Returns the magnitude in milliamperes, limited to 65 535.
    pub const fn magnitude(self) -> u16 {
        let magnitude = self.0.unsigned_abs();
        if magnitude > u16::MAX as u32 { u16::MAX } else { magnitude as u16 }
    }
}
