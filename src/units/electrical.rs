//! Voltages, and what a winding is made of.

use super::{CountsPerSecond, RangeError, nearest};
use core::num::NonZeroU16;
use fixed::types::{I12F20, I44F20};

/// The nearest whole number, if it is 1 to 65 535.
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
    /// Whole millivolts.
    pub const fn new(mv: u16) -> Self {
        Self(mv)
    }

    /// From volts, rounded to the nearest millivolt.
    ///
    /// # Errors
    /// [`RangeError::Voltage`] unless 0 to 65.535 V.
    pub const fn from_volts(volts: f64) -> Result<Self, RangeError> {
        match nearest(1e3 * volts) {
            Some(mv) if 0 <= mv && mv <= u16::MAX as i64 => Ok(Self(mv as u16)),
            _ => Err(RangeError::Voltage),
        }
    }

    /// 0 to 65 535.
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Volts, to the nearest single.
    pub const fn to_volts(self) -> f32 {
        self.0 as f32 / 1000.0
    }
}

/// An energy, 0 to 1.8e13 J in steps of 1 uJ; what is more stays at the upper end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Microjoules(u64);

impl Microjoules {
    /// None.
    pub const ZERO: Self = Self(0);

    /// And so much more.
    #[must_use]
    pub const fn plus(self, microjoules: u32) -> Self {
        Self(self.0.saturating_add(microjoules as u64))
    }

    /// Microjoules.
    pub const fn get(self) -> u64 {
        self.0
    }
}

/// A winding's resistance, 1 to 65 535 milliohms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Resistance(NonZeroU16);

impl Resistance {
    /// Whole milliohms.
    ///
    /// # Errors
    /// [`RangeError::Resistance`] if 0.
    pub const fn from_milliohms(mohm: u16) -> Result<Self, RangeError> {
        match NonZeroU16::new(mohm) {
            Some(mohm) => Ok(Self(mohm)),
            None => Err(RangeError::Resistance),
        }
    }

    /// From ohms, rounded to the nearest milliohm.
    ///
    /// # Errors
    /// [`RangeError::Resistance`] unless that is 1 to 65 535 milliohms.
    pub const fn from_ohms(ohms: f64) -> Result<Self, RangeError> {
        match nearest_u16(1e3 * ohms) {
            Some(mohm) => Ok(Self(mohm)),
            None => Err(RangeError::Resistance),
        }
    }

    /// 1 to 65 535.
    pub const fn as_milliohms(self) -> u16 {
        self.0.get()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Resistance {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{} mohm", self.as_milliohms());
    }
}

/// A winding's inductance, 1 to 65 535 microhenries. One that nobody has measured is an
/// `Option<Inductance>` of `None`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Inductance(NonZeroU16);

impl Inductance {
    /// Whole microhenries.
    ///
    /// # Errors
    /// [`RangeError::Inductance`] if 0.
    pub const fn from_microhenries(uh: u16) -> Result<Self, RangeError> {
        match NonZeroU16::new(uh) {
            Some(uh) => Ok(Self(uh)),
            None => Err(RangeError::Inductance),
        }
    }

    /// From millihenries, rounded to the nearest microhenry.
    ///
    /// # Errors
    /// [`RangeError::Inductance`] unless that is 1 to 65 535 microhenries.
    pub const fn from_millihenries(mh: f64) -> Result<Self, RangeError> {
        match nearest_u16(1e3 * mh) {
            Some(uh) => Ok(Self(uh)),
            None => Err(RangeError::Inductance),
        }
    }

    /// 1 to 65 535.
    pub const fn as_microhenries(self) -> u16 {
        self.0.get()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Inductance {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{} uH", self.as_microhenries());
    }
}

/// Back-EMF constant keFw in millivolts per count per second, 6q20: above 0, below 32, in steps of
/// 2^-20 (paper, revision of 31 August 2018; the largest known motor has 18.72).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EmfConstant(I12F20);

impl EmfConstant {
    /// From the motor's constant Ke in V s/rad and the encoder's counts per revolution of the same shaft,
    /// rounded to the nearest step: keFw = 2000 pi Ke / counts.
    ///
    /// ```
    /// # use motor_hub::units::{EmfConstant, constant};
    /// // AndyMark NeveRest 60; the encoder sits on the motor's own shaft.
    /// const NEVEREST_60: EmfConstant = constant!(EmfConstant::from_ke(0.017_766_667, 28.0));
    /// assert_eq!(NEVEREST_60.to_bits(), 4_180_495); // 3.98683 mV s/count
    /// ```
    ///
    /// # Errors
    /// [`RangeError::EmfConstant`] if either is not above 0 or keFw is out of this type's range.
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

    /// From its 6q20 bits: 1 to 2^25 - 1.
    ///
    /// # Errors
    /// [`RangeError::EmfConstant`] outside that range.
    pub const fn from_bits(bits: i32) -> Result<Self, RangeError> {
        if bits > 0 && bits < 1 << 25 {
            Ok(Self(I12F20::from_bits(bits)))
        } else {
            Err(RangeError::EmfConstant)
        }
    }

    /// 6q20 bits.
    pub const fn to_bits(self) -> i32 {
        self.0.to_bits()
    }

    /// Volts per count per second, to the nearest single.
    pub const fn to_volts(self) -> f32 {
        self.to_bits() as f32 / (1e3 * (1 << 20) as f32)
    }

    /// The back EMF at `speed`.
    ///
    /// The product is formed in 64 bits: in 32 it overflows at 513 counts/s for a NeveRest 60.
    pub const fn emf(self, speed: CountsPerSecond) -> Emf {
        // Steps of 2^-28 mV, below 2^56.
        let product = speed.to_bits() as i64 * self.to_bits() as i64;
        let bits = (product + (1 << 7)) >> 8;
        let bits = if bits > Emf::MAX {
            Emf::MAX
        } else if bits < -Emf::MAX {
            -Emf::MAX
        } else {
            bits
        };
        Emf(I44F20::from_bits(bits))
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for EmfConstant {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}/2^20 mV s/count", self.to_bits());
    }
}

/// A back EMF in steps of 2^-20 mV. Positive when turning CW; beyond +-131 071 mV, far above any battery,
/// the end of that range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Emf(I44F20);

impl Emf {
    /// The largest magnitude, steps of 2^-20 mV.
    const MAX: i64 = 131_071 << 20;

    /// Steps of 2^-20 mV.
    pub const fn to_bits(self) -> i64 {
        self.0.to_bits()
    }

    /// Volts, to the nearest single.
    pub const fn to_volts(self) -> f32 {
        (self.to_bits() >> 16) as i32 as f32 / 16_000.0
    }

    /// Millivolts, for reports.
    pub fn to_f64(self) -> f64 {
        self.0.to_num()
    }
}

/// The steady voltage across a motor that stands for what a bridge does to it on average: back EMF plus mean
/// current times resistance (paper, section 2.1). Signed, positive is CW; in steps of 1/16 mV, up to +-134 217 V.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Voltage(i32);

impl Voltage {
    /// From volts, rounded towards 0; beyond the range its end, and 0 from what is no number.
    pub const fn from_volts(volts: f32) -> Self {
        let bits = (volts * 16_000.0) as i32;
        // So that the range is symmetric.
        Self(if bits == i32::MIN { -i32::MAX } else { bits })
    }

    /// Steps of 1/16 mV.
    pub const fn to_bits(self) -> i32 {
        self.0
    }

    /// The same the other way.
    #[must_use]
    pub const fn reversed(self) -> Self {
        // In range: the range is symmetric.
        Self(-self.0)
    }

    /// In volts.
    pub const fn to_volts(self) -> f32 {
        self.0 as f32 / 16_000.0
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Voltage {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{} mV", self.0 / 16);
    }
}

/// A current in milliamperes: +-2 147 483 A.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Milliamperes(i32);

impl Milliamperes {
    /// None.
    pub const ZERO: Self = Self(0);

    /// Whole milliamperes.
    pub const fn new(milliamperes: i32) -> Self {
        Self(milliamperes)
    }

    /// From amperes, rounded towards 0; beyond the range its end, and 0 from what is no number.
    pub const fn from_amperes(amperes: f32) -> Self {
        Self((1000.0 * amperes) as i32)
    }

    /// Milliamperes.
    pub const fn get(self) -> i32 {
        self.0
    }
}
