//! Numbers, words and names in a scenario file. Each kind of number has a range; a value out of its range is refused.

use serde::de::{Deserialize, Deserializer, Error, Unexpected, Visitor};
use std::fmt::{self, Formatter};
use std::ops::RangeInclusive;

/// The longest run, in seconds: a trace must fit in memory.
pub const LONGEST_S: f64 = 300.0;

/// Characters of the longest number that is written without an exponent. Each `f64` has at most 17 digits.
const LONGEST_TEXT: usize = 20;

/// Highest speed in counts/s: ten times the speed of any known motor.
pub(crate) const FASTEST_CPS: i32 = 1_000_000;

/// Reads a number from `low` to `high`.
struct Limits {
    low: f64,
    high: f64,
    whole: bool,
}

impl Visitor<'_> for Limits {
    type Value = f64;

    fn expecting(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(if self.whole { "a whole number" } else { "a number" })
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<f64, E> {
        self.visit_f64(number as f64)
    }

    /// A whole number may be written as 1e3.
    fn visit_f64<E: Error>(self, number: f64) -> Result<f64, E> {
        if self.whole && number.fract() != 0.0 && !number.is_infinite() {
            return Err(E::invalid_type(Unexpected::Float(number), &self));
        }
        let range = self.low..=self.high;
        if range.contains(&number) { Ok(number) } else { Err(E::custom(out_of_range("", number, range))) }
    }
}

/// A number as text, with an exponent if the number has many digits.
pub fn number_text(value: f64) -> String {
    let text = value.to_string();
    if text.len() > LONGEST_TEXT { format!("{value:e}") } else { text }
}

/// Message for a number out of its range. If `key` is empty, `Fault::of_toml` finds the key by its position in the
/// text.
pub(crate) fn out_of_range(key: &str, value: f64, range: RangeInclusive<f64>) -> String {
    let value = number_text(value);
    let message = format!("{key} = {value} is out of range; allowed is {} to {}", range.start(), range.end());
    message.trim_start().to_owned()
}

/// Defines kinds of numbers, each with its type and its range.
macro_rules! numbers {
    ($($(#[$doc:meta])* $name:ident($inner:ty): $low:expr, $high:expr;)+) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $name(pub(crate) $inner);

        impl From<$name> for $inner {
            fn from(number: $name) -> Self {
                number.0
            }
        }

        impl<'de> Deserialize<'de> for $name {
            fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
                // A cast of 0.5 to an integer type is 0.
                let whole = 0.5_f64 as $inner == 0 as $inner;
                let limits = Limits { low: $low as f64, high: $high as f64, whole };
                from.deserialize_any(limits).map(|number| Self(number as $inner))
            }
        }
    )+};
}

numbers! {
    /// Length of a run in s.
    Duration(f64): 0.001, LONGEST_S;
    SettlingTime(f64): 0.0, LONGEST_S;
    PeriodMs(u32): 1, 100;
    Seed(u32): 0, u32::MAX;
    /// Voltage of a battery without load, in V.
    BatteryEmf(f64): 1.0, 60.0;
    /// Resistance of a battery in ohms.
    BatteryResistance(f64): 0.0, 1.0;
    /// Capacitance of a bus in F.
    Capacitance(f64): 1e-5, 1.0;
    /// Voltage of a bus in V.
    BusVoltage(f64): 0.0, 100.0;
    /// Voltage at an analog input in V.
    AnalogVoltage(f64): 0.0, 3.3;
    /// Number of a digital pin.
    PinNumber(u8): 0, 7;
    /// Ke in V s/rad or Kt in N m/A.
    MotorConstant(f64): 1e-5, 10.0;
    /// Resistance in ohms or inductance in mH of a winding.
    WindingConstant(f64): 0.001, 65.535;
    /// Inertia of a rotor in kg m².
    RotorInertia(f64): 1e-9, 1.0;
    /// Drag of a motor in N m s/rad.
    MotorDrag(f64): 0.0, 1.0;
    GearRatio(f64): 0.001, 100_000.0;
    Efficiency(f64): 0.01, 1.0;
    CountsPerRev(f64): 1.0, 1e6;
    /// Inertia in kg m² or drag in N m s/rad of a load.
    OfLoad(f64): 0.0, 1000.0;
    /// Stiffness of a shaft between motor and load, in N m/rad.
    Stiffness(f64): 0.001, 100_000.0;
    /// Angle of a backlash at the output shaft, in degrees.
    Backlash(f64): 0.0, 90.0;
    /// Temperature above the temperature of a cold motor, in K.
    TemperatureRise(f64): 0.0, 200.0;
    /// Torque on an output shaft in N m.
    Torque(f64): -1000.0, 1000.0;
    /// Torque in percent of the motor's stall torque at 12 V.
    Percent(f64): 0.0, 100.0;
    RestPositions(u16): 1, 1000;
    /// Configured constant divided by the true constant.
    Factor(f64): 0.1, 10.0;
    DragFactor(f64): 0.0, 10.0;
    /// Limit of a current in A.
    CurrentLimit(f64): 0.001, 65.535;
    /// Current of a set-point in A.
    Current(f64): -65.535, 65.535;
    /// Time constant in s.
    Seconds(u16): 1, u16::MAX;
    /// Coefficient of a control loop, as a Q16.16 number can hold.
    CoefficientValue(f64): 0.0, 32_767.0;
    /// Share of the full control value.
    Power(f64): -1.0, 1.0;
    /// Speed in counts/s.
    Speed(i32): -FASTEST_CPS, FASTEST_CPS;
    SpeedLimit(i32): 1, FASTEST_CPS;
    /// Highest speed minus lowest speed, in counts/s.
    Swing(f64): 0.0, 2 * FASTEST_CPS;
    /// Acceleration in counts/s². The largest acceleration takes a motor to the highest speed in a millisecond.
    AccelerationLimit(u32): 1, 1_000_000_000;
    /// Position in counts.
    Counts(i32): i32::MIN, i32::MAX;
    /// Tolerance or lag in counts.
    Distance(u16): 0, u16::MAX;
    /// Glitches per second. A glitch lasts for up to 0.5 us.
    Glitches(u32): 1, 100_000;
    /// Slots of an encoder's disc.
    Slots(u32): 1, 10_000;
    /// Wheel diameter or track width of a drive base, in mm.
    Length(f64): 1.0, 1e6;
    /// Part of a turn that wheels lose by slipping.
    Slip(f64): 0.0, 0.9;
    /// Drift of a gyro in degrees per minute.
    Drift(f64): -60.0, 60.0;
    /// Share by which a gyro's turns are too large.
    ScaleError(f64): -0.1, 0.1;
    /// Distance on a course in mm, turn in degrees, counts per turn of a wheel, or diameter of a wheel in mm.
    WithinMillion(f64): -1e6, 1e6;
    /// Expected speed in counts/s.
    SpeedBound(f64): -FASTEST_CPS, FASTEST_CPS;
    /// Expected position in counts.
    PositionBound(f64): i32::MIN, i32::MAX;
    /// Overshoot in percent, or change of a current in A.
    UpTo1000(f64): 0.0, 1000.0;
    /// Energy in J.
    Energy(f64): 0.0, 1e6;
    Degrees(f64): 0.0, 360.0;
}

/// Reads a field as a number of one kind: `#[serde(deserialize_with = "within::<Slip, _, _>")]`.
pub(crate) fn within<'de, Kind, T, D>(from: D) -> Result<T, D::Error>
where
    Kind: Deserialize<'de> + Into<T>,
    D: Deserializer<'de>,
{
    Kind::deserialize(from).map(Into::into)
}

/// Reads one of these words, and returns the value of the word.
pub(crate) fn one_of<'de, T: Copy, D: Deserializer<'de>>(
    from: D,
    words: &[(&str, T)],
) -> Result<T, D::Error> {
    let word = String::deserialize(from)?;
    let known = words.iter().find(|(known, _)| *known == word);
    known.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<_> = words.iter().map(|(name, _)| format!("`{name}`")).collect();
        Error::custom(format!("unknown variant `{word}`, expected one of {}", names.join(", ")))
    })
}

/// Returns the given value, or `absent` if no value is given.
pub(crate) fn or<T>(given: Option<impl Into<T>>, absent: T) -> T {
    given.map_or(absent, Into::into)
}

/// A name without control characters. Spaces at both ends are removed; the name then has 1 to 80 characters.
#[derive(serde::Deserialize)]
#[serde(try_from = "String")]
pub(crate) struct Name(pub(crate) String);

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let name = text.trim();
        let printable = !name.is_empty() && name.chars().count() <= 80 && !name.chars().any(char::is_control);
        if printable {
            Ok(Self(name.to_owned()))
        } else {
            Err(format!("= {text:?} is refused; it must be 1 to 80 printable characters"))
        }
    }
}
