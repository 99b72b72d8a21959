//! Expectations of a scenario's run. Studies measure and judge them.
//!
//! ```
//! use simulated::scenario::expectation::Quantity;
//!
//! assert_eq!(Quantity::SettlingTime.key(), "settles_within_s");
//! ```

use motor_hub::braking::Regime;
use motor_hub::record::Fault;
use std::fmt;
use std::ops::Range;

/// One expectation of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// What the expectation is about.
    pub subject: Subject,
    /// Part of the run that the expectation is about, in seconds since the start.
    pub window_s: Range<f64>,
    /// The expected quantity, regime or fault.
    pub expected: Expected,
}

/// The subject of an expectation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Subject {
    /// A motor, by its index.
    Motor(usize),
    /// A group, by its index.
    Group(usize),
    /// The battery.
    Battery,
}

/// An expected quantity, regime or fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Expected {
    /// A quantity lies between the lowest and the highest allowed value. A quantity that changes with time lies between them during the whole window.
    Quantity(Quantity, [f64; 2]),
    /// The motor is in this regime at one control tick or more. `None` means an open bridge.
    Ever(Option<Regime>),
    /// The motor is in this regime at no control tick. `None` means an open bridge.
    Never(Option<Regime>),
    /// This fault and no other fault occurs. `None` means that no fault occurs.
    Fault(Option<Fault>),
}

impl fmt::Display for Expected {
    /// Writes the expectation in words.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Quantity(quantity, [low, high]) => match quantity {
                Quantity::SettlingTime => write!(f, "settles within {high} s"),
                Quantity::Overshoot => write!(f, "overshoot at most {high} %"),
                Quantity::Speed => write!(f, "speed {low} to {high} counts/s"),
                Quantity::Position => write!(f, "position {low} to {high} counts"),
                Quantity::Swing => write!(f, "swing {low} to {high} counts/s"),
                Quantity::CurrentStep => write!(f, "steps of the braking current at most {high} A"),
                Quantity::EnergyReturned => write!(f, "energy returned {low} to {high} J"),
                Quantity::HeadingError => write!(f, "heading error at most {high} degrees"),
                Quantity::Bus => write!(f, "bus {low} to {high} V"),
            },
            Self::Ever(regime) => write!(f, "{} at times", regime_name(regime)),
            Self::Never(regime) => write!(f, "never {}", regime_name(regime)),
            Self::Fault(None) => f.write_str("no fault"),
            Self::Fault(Some(fault)) => write!(f, "fault: {}", fault.word().unwrap_or_default()),
        }
    }
}

/// A measured quantity of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Longest time in seconds until a motor has settled after a change of set-point or torque, or until a group has
    /// arrived.
    SettlingTime,
    /// Largest overshoot after a change of set-point or torque, in percent.
    Overshoot,
    /// True speed in counts per second.
    Speed,
    /// True position in encoder counts.
    Position,
    /// Difference of the highest and the lowest true speed, in counts per second.
    Swing,
    /// Largest change of the mean motor current from one control period to the next while the motor slows down, in
    /// amperes.
    CurrentStep,
    /// Energy that the motor's bridge returned to the battery, in joules.
    EnergyReturned,
    /// Largest heading error of a drive base on its course, in degrees.
    HeadingError,
    /// Voltage at the battery's terminals in volts.
    Bus,
}

impl Quantity {
    /// The key of an expectation about the quantity in scenario files.
    pub const fn key(self) -> &'static str {
        match self {
            Self::SettlingTime => "settles_within_s",
            Self::Overshoot => "overshoot_below_percent",
            Self::Speed => "speed_between_cps",
            Self::Position => "position_between_counts",
            Self::Swing => "swing_between_cps",
            Self::CurrentStep => "current_step_below_a",
            Self::EnergyReturned => "energy_returned_between_j",
            Self::HeadingError => "heading_error_below_degrees",
            Self::Bus => "bus_between_v",
        }
    }
}

/// The name of a regime in scenario files and documents; `coast` for an open bridge: disabled, floating or at fault.
pub const fn regime_name(regime: Option<Regime>) -> &'static str {
    match regime {
        Some(regime) => regime.name(),
        None => "coast",
    }
}
