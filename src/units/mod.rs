//! Quantities of the control path: fixed-point types with a stated range and resolution. The documentation of a
//! conversion says whether the conversion rounds, limits a value to the range, or fails out of range.
//!
//! | quantity | range | resolution |
//! |---|---|---|
//! | [`Control`] | +-32 767 | 1 |
//! | [`Duty`], [`Share`] | 0 to 1 | 2^-15 |
//! | [`Coefficient`] of a PIDF | -32 768 to below 32 768 | 2^-16 |
//! | [`Millivolts`] | 0 to 65 535 mV | 1 mV |
//! | [`Milliamperes`] | +-2^31 mA | 1 mA |
//! | [`Microjoules`] | 0 to 2^64 - 1 uJ | 1 uJ |
//! | [`Resistance`] | 1 to 65 535 mohm | 1 mohm |
//! | [`Inductance`] | 1 to 65 535 uH | 1 uH |
//! | [`EmfConstant`] | above 0, below 32 mV s/count | 2^-20 |
//! | [`Emf`] | +-131 071 mV | 2^-20 mV |
//! | [`Voltage`] across a motor, average | +-134 217 V | 1/16 mV |
//! | [`CountsPerSecond`] | +-8 388 607 | 2^-8 |
//! | [`AccelerationPerVolt`] | above 0, below 2^24 counts/s² per V | 2^-8 |
//! | [`DecayRate`] | 0 to below 65 536 per second | 2^-16 |
//! | [`Acceleration`] | 1 to 2^32 - 1 counts/s² | 1 |
//! | [`Micros`] since boot | 64 bits | 1 us |
//! | [`Period`] of control | 1 to 100 ms | 1 ms |
//!
//! The number inside each type is private. `new` takes whole units, and `from_...` names the unit of its argument. A
//! constructor that can fail returns a [`RangeError`]. `get` and `as_...` return whole units. `to_...` returns
//! fixed-point bits, a float, or a number that is rounded to whole units.
//!
//! Data sheets use ohms, rpm and V s/rad. Constructors from these units take `f64` and are called at compile time or at
//! set-up. The control path does not use `f64`. [`constant!`] checks a range while the program is compiled:
//!
//! ```
//! use motor_hub::units::{EmfConstant, Resistance, constant};
//!
//! const WINDING: Resistance = constant!(Resistance::from_ohms(3.3));
//! const NEVEREST_60: EmfConstant = constant!(EmfConstant::from_ke(0.017_766_667, 28.0));
//! assert_eq!(WINDING.as_milliohms(), 3_300);
//! assert_eq!(NEVEREST_60.to_bits(), 4_180_495); // 3.98683 mV s/count in 6q20
//! ```
//!
//! A value out of range is a compile error:
//!
//! ```compile_fail,E0080
//! use motor_hub::units::{Resistance, constant};
//!
//! const WINDING: Resistance = constant!(Resistance::from_ohms(66.0));
//! ```

/// Prints a quantity to the log of a board: a text with the number that a method of the quantity returns.
macro_rules! logged {
    ($quantity:ty, $text:literal, $number:ident) => {
        #[cfg(feature = "defmt")]
        impl defmt::Format for $quantity {
            fn format(&self, f: defmt::Formatter<'_>) {
                defmt::write!(f, $text, self.$number());
            }
        }
    };
}

mod control;
mod dynamics;
mod electrical;
mod motion;
pub(crate) mod single;
mod time;

pub use control::{Coefficient, Control, Duty, Share};
pub use dynamics::{Acceleration, AccelerationPerVolt, DecayRate};
pub use electrical::{
    Emf, EmfConstant, Inductance, Microjoules, Milliamperes, Millivolts, Resistance, Voltage,
};
pub use motion::CountsPerSecond;
pub use time::{Micros, Period};

#[doc(inline)]
pub use crate::constant;

/// Evaluates a checked constructor at compile time. Its arguments must be constants. A value out of range is a compile
/// error, so the program has no error to handle at run time.
#[doc(hidden)]
#[macro_export]
macro_rules! constant {
    ($constructor:expr) => {
        const {
            match $constructor {
                Ok(value) => value,
                Err(_) => panic!("out of range"),
            }
        }
    };
}

/// Rounds to the nearest whole number, halves away from 0. `None` for NaN and for magnitudes of 2^62 and above.
pub(crate) const fn nearest(value: f64) -> Option<i64> {
    const LIMIT: f64 = (1_u64 << 62) as f64;
    if !(-LIMIT < value && value < LIMIT) {
        return None;
    }
    let whole = value as i64;
    let rest = value - whole as f64;
    if rest >= 0.5 {
        Some(whole + 1)
    } else if rest <= -0.5 {
        Some(whole - 1)
    } else {
        Some(whole)
    }
}

/// True if the command `number` is the command `newest` or an older command. Numbers count since boot and wrap at 2^32,
/// so `number` counts as older if it is less than 2^31 behind `newest`.
///
/// ```
/// use motor_hub::units::is_included;
///
/// assert!(is_included(7, 7) && is_included(7, 8) && !is_included(8, 7));
/// // The number after 2^32 - 1 is 0.
/// assert!(is_included(u32::MAX, 0) && !is_included(0, u32::MAX));
/// ```
pub const fn is_included(number: u32, newest: u32) -> bool {
    newest.wrapping_sub(number) < 1 << 31
}

/// A quantity is out of its range. Each variant names the quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum RangeError {
    /// The back-EMF constant must lie above 0 and below 32 mV s/count.
    EmfConstant,
    /// A back EMF must lie in -131.071 to 131.071 V.
    Emf,
    /// A voltage must lie in 0 to 65.535 V.
    Voltage,
    /// A resistance must lie in 0.001 to 65.535 ohm.
    Resistance,
    /// An inductance must lie in 0.001 to 65.535 mH.
    Inductance,
    /// An acceleration per volt must lie above 0 and below 2^24 counts/s² per volt.
    AccelerationPerVolt,
    /// A decay rate must be at least 0 and below 65 536 per second.
    DecayRate,
    /// An acceleration limit must be above 0.
    Acceleration,
    /// A speed must lie within +-8 388 607 counts/s, and the counts per revolution must be above 0.
    Speed,
    /// A distance must lie within +-(2^31 - 1) counts.
    Distance,
    /// A blend must lie in 0 to 1.
    Blend,
    /// The control period must be 1 to 100 ms.
    Period,
    /// Both resistances of a voltage divider must be above 0.
    Divider,
    /// The resolution of an analogue-to-digital converter must be 1 to 16 bits.
    Resolution,
    /// The voltage levels of a supply must be in ascending order. The message lists them.
    SupplyLevels,
    /// The diode drop, the switch resistance and the PWM frequency of a bridge must be in their ranges.
    Bridge,
    /// The reference voltage and the millivolts per ampere of a current sense must be above 0.
    Sense,
    /// The current and the time constants of a thermal limit must be above 0.
    Thermal,
    /// The hub has no motor with this index.
    Motor,
    /// A drive base must have two different motors, and its dimensions must be in their ranges. The message lists them.
    DriveBase,
}

impl core::fmt::Display for RangeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::EmfConstant => "back-EMF constant must be above 0 and below 32 mV s/count",
            Self::Emf => "back EMF must be -131.071 to 131.071 V",
            Self::Voltage => "voltage must be 0 to 65.535 V",
            Self::Resistance => "resistance must be 0.001 to 65.535 ohm",
            Self::Inductance => "inductance must be 0.001 to 65.535 mH",
            Self::AccelerationPerVolt => {
                "acceleration per volt must be above 0 and below 16777216 counts/s^2/V"
            }
            Self::DecayRate => "decay rate must be at least 0 and below 65536 per second",
            Self::Acceleration => "acceleration must be 1 to 4294967295 counts/s^2",
            Self::Speed => "speed must be -8388607 to 8388607 counts/s, counts per revolution above 0",
            Self::Distance => "distance must be -2147483647 to 2147483647 counts",
            Self::Blend => "blend must be 0 to 1",
            Self::Period => "control period must be 1 to 100 ms",
            Self::Divider => "both resistances of the battery divider must be above 0",
            Self::Resolution => "resolution of the converter must be 1 to 16 bits",
            Self::SupplyLevels => {
                "supply levels must be min <= cutoff < derate <= recover < dissipate < ceiling <= max"
            }
            Self::Bridge => {
                "diode drop must be 0 to 2000 mV, switch resistance 0 to 4095 mohm, PWM 100 to 200000 Hz"
            }
            Self::Sense => "current sense: reference and millivolts per ampere must be above 0",
            Self::Thermal => "thermal limit: current must be above 0 mA, time constants above 0 s",
            Self::Motor => "the hub has no motor with this index",
            Self::DriveBase => {
                "drive base must have two different motors, wheels and a track of 1 mm to 10 m, and counts per turn of \
                 1 to 2147483, negative for a motor that counts down while its wheel drives forward"
            }
        })
    }
}

impl core::error::Error for RangeError {}
