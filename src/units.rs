//! Quantities of the control path: fixed-point newtypes with their range, resolution and checked
//! conversions. Nothing here rounds or clamps without saying so.

use fixed::types::{I12F20, I16F16, I24F8, I44F20, U1F15};

/// The PID loop's control value: -32767 to 32767, positive for CW.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Control(i16);

impl Control {
    /// No effort.
    pub const ZERO: Self = Self(0);
    /// The positive end of the range, `controlMax` in the paper.
    pub const MAX: Self = Self(i16::MAX);
    /// The negative end of the range.
    pub const MIN: Self = Self(-i16::MAX);

    /// A control value; -32768 becomes -32767 so that the range is symmetric.
    pub const fn new(value: i16) -> Self {
        if value == i16::MIN { Self::MIN } else { Self(value) }
    }

    /// Clamps to the range.
    pub const fn saturating(value: i64) -> Self {
        if value > Self::MAX.0 as i64 {
            Self::MAX
        } else if value < Self::MIN.0 as i64 {
            Self::MIN
        } else {
            Self(value as i16)
        }
    }

    /// -32767 to 32767.
    pub const fn get(self) -> i16 {
        self.0
    }
}

impl Control {
    /// The same the other way.
    #[must_use]
    pub const fn reversed(self) -> Self {
        // In range: -32768 is not a value of this type.
        Self(-self.0)
    }
}

impl core::ops::Neg for Control {
    type Output = Self;
    fn neg(self) -> Self {
        self.reversed()
    }
}

/// Share of a PWM period, 0 to 1 in steps of 2^-15. Both ends are exact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Duty(U1F15);

impl Duty {
    /// Never.
    pub const ZERO: Self = Self(U1F15::ZERO);
    /// Always.
    pub const ONE: Self = Self(U1F15::ONE);

    /// From steps of 2^-15; more than 32768 becomes 1.
    pub const fn from_bits(bits: u16) -> Self {
        if bits > Self::ONE.0.to_bits() { Self::ONE } else { Self(U1F15::from_bits(bits)) }
    }

    /// `part / whole`, rounded to nearest; 0 if `part <= 0` or `whole <= 0`, 1 if `part >= whole`.
    ///
    /// `part` and `whole` may be anything below 2^47.
    pub const fn ratio(part: i64, whole: i64) -> Self {
        if part <= 0 || whole <= 0 {
            Self::ZERO
        } else if part >= whole {
            Self::ONE
        } else {
            Self::from_bits((((part << 15) + whole / 2) / whole) as u16)
        }
    }

    /// Steps of 2^-15, 0 to 32768.
    pub const fn to_bits(self) -> u16 {
        self.0.to_bits()
    }

    /// Timer compare value for a period of `period` ticks, rounded to nearest: 0 to `period`.
    pub const fn of_period(self, period: u16) -> u16 {
        ((self.0.to_bits() as u32 * period as u32 + (1 << 14)) >> 15) as u16
    }

    /// For plots and models.
    pub fn to_f64(self) -> f64 {
        f64::from(self.0)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Duty {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}/32768", self.to_bits());
    }
}

/// A battery voltage, 0 to 65 535 mV.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Millivolts(pub u16);

/// Encoder speed in counts per second: +-8 388 607, in steps of 1/256. Positive is CW.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct CountsPerSecond(I24F8);

impl CountsPerSecond {
    /// Standstill.
    pub const ZERO: Self = Self(I24F8::ZERO);

    /// Whole counts per second; beyond +-8 388 607 the end of the range.
    pub fn new(cps: i32) -> Self {
        Self(I24F8::saturating_from_num(cps))
    }

    /// From steps of 1/256 count per second.
    pub const fn from_bits(bits: i32) -> Self {
        Self(I24F8::from_bits(bits))
    }

    /// From steps of 1/256 count per second; beyond 32 bits the end of the range.
    pub fn saturating_from_bits(bits: i64) -> Self {
        Self(I24F8::from_bits(bits.clamp(-i64::from(i32::MAX), i64::from(i32::MAX)) as i32))
    }

    /// Steps of 1/256 count per second.
    pub const fn to_bits(self) -> i32 {
        self.0.to_bits()
    }

    /// Rounded to whole counts per second.
    pub fn round(self) -> i32 {
        self.0.saturating_add(I24F8::from_bits(1 << 7)).to_num()
    }

    /// For plots and models.
    pub fn to_f64(self) -> f64 {
        f64::from(self.0)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for CountsPerSecond {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{} cps", self.round());
    }
}

/// What is wrong with a number that a user gave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RangeError {
    /// The back-EMF constant must lie above 0 and below 32 mV s/count.
    EmfConstant,
    /// A blend must lie in 0 to 1.
    Blend,
    /// The control period must be 1 to 100 ms.
    Period,
    /// A divider needs both resistances above 0.
    Divider,
    /// A winding or a bridge is out of the ranges stated with it.
    Electrical,
    /// There is no motor with this index.
    Motor,
}

impl core::fmt::Display for RangeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::EmfConstant => "back-EMF constant must be above 0 and below 32 mV s/count",
            Self::Blend => "blend must be 0 to 1",
            Self::Period => "control period must be 1 to 100 ms",
            Self::Divider => "both resistances of the battery divider must be above 0",
            Self::Electrical => {
                "resistance must be 1 to 65535 mohm, diode drop up to 2000 mV, switch up to 4095 mohm, PWM 100 to 200000 Hz"
            }
            Self::Motor => "no motor with this index",
        })
    }
}

impl core::error::Error for RangeError {}

/// Back-EMF constant keFw in millivolts per count per second, 6q20: above 0, below 32, in steps of
/// 2^-20 (paper, revision of 31 August 2018; the largest known motor has 18.72).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EmfConstant(I12F20);

impl EmfConstant {
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

    /// The back EMF at `speed`.
    ///
    /// The product is formed in 64 bits: in 32 it overflows at 513 counts/s for a NeveRest 60.
    pub const fn emf(self, speed: CountsPerSecond) -> Emf {
        Emf(speed.to_bits() as i64 * self.to_bits() as i64)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for EmfConstant {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}/2^20 mV s/count", self.to_bits());
    }
}

/// A back EMF. Positive when turning CW; beyond +-131 071 mV, far above any battery, the end of that
/// range.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Emf(
    /// The product of speed and constant, exact, in steps of 2^-28 mV: below 2^56. Whoever needs less
    /// takes less.
    i64,
);

impl Emf {
    /// The largest magnitude, in millivolts.
    const MAX_MV: i32 = 131_071;

    /// Steps of 2^-20 mV, rounded.
    pub const fn to_bits(self) -> i64 {
        const MAX: i64 = (Emf::MAX_MV as i64) << 20;
        let bits = (self.0 + (1 << 7)) >> 8;
        if bits > MAX {
            MAX
        } else if bits < -MAX {
            -MAX
        } else {
            bits
        }
    }

    /// Steps of 1/8 mV, rounded: within 20 bits and a sign.
    pub const fn eighths(self) -> i32 {
        // 32 bits hold it: the product is below 2^56.
        let bits = ((self.0 + (1 << 24)) >> 25) as i32;
        if bits > (1 << 20) - 1 {
            (1 << 20) - 1
        } else if bits < -(1 << 20) {
            -(1 << 20)
        } else {
            bits
        }
    }

    /// True if it is that of CCW motion.
    pub const fn is_negative(self) -> bool {
        self.0 < 0
    }

    /// Millivolts, for reports.
    pub fn to_f64(self) -> f64 {
        I44F20::from_bits(self.to_bits()).to_num()
    }
}

/// A PIDF coefficient, signed Q16.16 as hosts send it: -32 768 to 32 767.99998.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Coefficient(I16F16);

impl Coefficient {
    /// No contribution.
    pub const ZERO: Self = Self(I16F16::ZERO);

    /// From Q16.16 bits. All are in range; that a negative one does what its owner wants is for the
    /// owner to know.
    pub const fn from_bits(bits: i32) -> Self {
        Self(I16F16::from_bits(bits))
    }

    /// Q16.16 bits.
    pub const fn to_bits(self) -> i32 {
        self.0.to_bits()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Coefficient {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}/65536", self.to_bits());
    }
}

/// Time since boot in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Micros(pub u64);

impl Micros {
    /// Microseconds from `earlier` to this, 0 if `earlier` is later.
    pub const fn since(self, earlier: Self) -> u64 {
        self.0.saturating_sub(earlier.0)
    }

    /// The same for times that are certain to be less than 71 minutes apart, in 32 bits.
    pub const fn wrapping_since(self, earlier: Self) -> u32 {
        (self.0 as u32).wrapping_sub(earlier.0 as u32)
    }
}

/// The control period: 1 to 100 ms, 50 by default as in the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Period(u8);

impl Period {
    /// 50 ms, the FTC firmware's interval (paper, section 1.3).
    pub const DEFAULT: Self = Self(50);

    /// A period of `ms` milliseconds.
    ///
    /// # Errors
    /// [`RangeError::Period`] unless 1 to 100.
    pub const fn from_millis(ms: u32) -> Result<Self, RangeError> {
        if ms >= 1 && ms <= 100 { Ok(Self(ms as u8)) } else { Err(RangeError::Period) }
    }

    /// 1 to 100.
    pub const fn as_millis(self) -> u32 {
        self.0 as u32
    }

    /// 1000 to 100 000.
    pub const fn as_micros(self) -> u64 {
        self.0 as u64 * 1000
    }
}

impl Default for Period {
    fn default() -> Self {
        Self::DEFAULT
    }
}
