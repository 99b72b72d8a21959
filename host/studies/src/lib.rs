//! Studies of the hub: measures of runs, comparisons, the paper's numbers and figures, answers to cases. Every study
//! returns a document (text for people, JSON for programs, figures); none prints or writes anything.
//!
//! | module | what it shows |
//! |---|---|
//! | [`settling`] | the one judge of whether a motor has settled |
//! | [`measures`] | numbers of a run: settling, overshoot, jerk, energy |
//! | [`expectations`] | whether a run meets its scenario's expectations |
//! | [`report`] | a scenario with and without a braking regime |
//! | [`recording`] | what a hub reported while a host drove its motors |
//! | [`compare`] | the same tasks under every scheme and duty rule |
//! | [`survey`] | how well motors are regulated: reference tasks, bare motors, random scenarios |
//! | [`square`] | where a drive base ends after a square, by encoders and by a gyro |
//! | [`identify`] | what the hub identifies of its motors, beside their true values |
//! | [`overlay`] | the flashed image beside the same core on the simulated board |
//! | [`points`] | S, T, Z, G at an operating point, and the duty of a control value |
//! | [`page`], [`table`] | sentences and tables for a terminal or as Markdown |
//! | [`paper`] | every number that the paper prints beside ours, and where its text is wrong |
//! | [`figures`] | the paper's figures and ours |
//! | [`eval`] | cases of a JSON document, answered by core and model |
//!
//! ```
//! use motor_hub::braking::Scheme;
//! use motor_hub::model::catalogue::characterised;
//! use studies::points::OperatingReport;
//!
//! let report = OperatingReport::new(characterised("NeveRest 60")?, Scheme::B, 1000, 12_000)?;
//! assert!(report.heading().starts_with("NeveRest 60 at 1000 counts/s on 12.000 V, scheme B"));
//! # Ok::<(), studies::StudyError>(())
//! ```
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
use motor_hub::units::RangeError;
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
    #[error("a task without an event")]
    NoEvent,
}

/// A figure and the name of its files.
pub type NamedFigure = (String, Figure);

/// A value of a motor over a run. The line has a name, a colour and a style.
fn line(
    (name, colour, style): (&str, &'static str, Style),
    trace: &Trace,
    motor: usize,
    value: impl Fn(&Sample) -> f64,
) -> Series {
    Series::new(name, colour, style, trace.motor(motor).map(|(at_s, sample)| (at_s, value(sample))))
}
