//! Studies of the hub: measures of runs, comparisons, the paper's numbers and figures, answers to cases. Every study
//! returns a document (text for people, JSON for programs, figures); none prints or writes anything.
#![forbid(unsafe_code)]

pub mod compare;
pub mod eval;
pub mod expectations;
pub mod figures;
mod groups;
pub mod identify;
pub mod measures;
pub mod overlay;
pub mod page;
pub mod paper;
pub mod points;
pub mod recording;
pub mod report;
pub mod settling;
pub mod square;
pub mod survey;
pub mod table;

use chart::{Figure, Series, Style};
use motor_hub::model::catalogue::UnknownMotor;
use motor_hub::motor::Setpoint;
use motor_hub::units::{CountsPerSecond, RangeError};
use serde_json::Value;
use simulated::scenario::Timed;
use simulated::sim::RunError;
use simulated::trace::{Sample, Trace};

/// Version of the documents and files for programs. It changes when a field is removed or changes its meaning. Fields
/// may be added at any time.
pub const SCHEMA_VERSION: u32 = 2;

/// Why a study could not be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum StudyError {
    /// The catalogue lacks a motor.
    #[error(transparent)]
    Motor(#[from] UnknownMotor),
    /// A quantity does not fit the firmware.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// A run did not finish.
    #[error(transparent)]
    Run(#[from] RunError),
    /// A bridge has no operating point without a supply.
    #[error("the battery voltage is 0")]
    NoBattery,
    /// A task of a comparison has no motor, or no event.
    #[error("a task of the comparison has no motor, or no event")]
    NoEvent,
}

/// A figure and the name of its files.
pub type NamedFigure = (String, Figure);

/// Adds further fields to a JSON object.
#[must_use]
pub fn with_fields(mut object: Value, more: Value) -> Value {
    if let (Value::Object(object), Value::Object(more)) = (&mut object, more) {
        object.extend(more);
    }
    object
}

/// A set-point of a speed in counts/s.
fn velocity(cps: i32) -> Setpoint {
    Setpoint::Velocity(CountsPerSecond::new(cps))
}

/// A set-point of a position in counts, with a tolerance of 10 counts.
fn position(target: i32, speed_limit: CountsPerSecond) -> Setpoint {
    Setpoint::Position { target, tolerance: 10, speed_limit }
}

/// Values with the times in seconds from which on they are in force.
fn timed<T>(values: impl IntoIterator<Item = (f64, T)>) -> Vec<Timed<T>> {
    values.into_iter().map(|(at_s, value)| Timed { at_s, value }).collect()
}

/// One motor in a run, whose values become the lines of a chart.
#[derive(Clone, Copy)]
struct Lines<'a> {
    trace: &'a Trace,
    motor: usize,
}

impl Lines<'_> {
    fn line(self, name: &str, colour: &'static str, style: Style, value: impl Fn(&Sample) -> f64) -> Series {
        Series::new(
            name,
            colour,
            style,
            self.trace.motor(self.motor).map(|(at_s, sample)| (at_s, value(sample))),
        )
    }
}
