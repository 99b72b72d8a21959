//! What can be wrong with a case.

use motor_hub::model::catalogue::UnknownMotor;
use motor_hub::units::RangeError;
use simulated::scheme::{BlendError, UnknownScheme};

/// Why a case could not be answered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// No `formula`, or no text.
    #[error("the case has no formula")]
    NoFormula,
    /// There is no such formula.
    #[error("unknown formula {0:?}")]
    UnknownFormula(String),
    /// No `inputs`.
    #[error("the case has no inputs")]
    NoInputs,
    /// An input is not there.
    #[error("input {0} is missing")]
    Missing(String),
    /// An input of another type.
    #[error("input {key} must be {kind}")]
    Kind {
        /// Which.
        key: String,
        /// "a number", "a text".
        kind: &'static str,
    },
    /// A text that is none of those allowed.
    #[error("input {key} = {given:?} must be {allowed}")]
    Word {
        /// Which input.
        key: &'static str,
        /// What it says.
        given: String,
        /// What it may say.
        allowed: &'static str,
    },
    /// A number below 0.
    #[error("input {key} = {value} must not be negative")]
    Negative {
        /// Which.
        key: String,
        /// As given.
        value: f64,
    },
    /// A number of 0 or less.
    #[error("{key} = {value} must be above 0")]
    NotPositive {
        /// Which.
        key: String,
        /// As given.
        value: f64,
    },
    /// No whole number, or out of range.
    #[error("input {key} = {value} must be a whole number from {low} to {high}")]
    NotWhole {
        /// Which.
        key: String,
        /// As given.
        value: f64,
        /// The least that is allowed.
        low: i64,
        /// The most that is allowed.
        high: i64,
    },
    /// A control value out of the control range.
    #[error("control {0} must be a whole number from -32767 to 32767")]
    Control(f64),
    /// A list that holds something else than numbers, or no list.
    #[error("{0} must be a list of numbers")]
    NotNumbers(String),
    /// A constant of a motor.
    #[error("motor constant {0} is missing, or is not a number")]
    MotorConstant(String),
    /// Points in another order than S < T <= Z < G.
    #[error("the points must ascend: S < T <= Z < G")]
    Points,
    /// A battery that the firmware cannot represent.
    #[error("input Vbat must be 0.001 to 65.535 V")]
    Battery,
    /// A time before the step.
    #[error("t_s must not be negative")]
    Time,
    /// A duty out of range.
    #[error("duty must be 0 to 1")]
    Duty,
    /// The back EMF is above the battery voltage.
    #[error("the back EMF must be below the battery voltage")]
    Overrun,
    /// The paper prints no such number.
    #[error("the paper prints no number with the name {0:?}")]
    UnknownNumber(String),
    /// Inputs that the formula does not read, such as misspelt ones.
    #[error("unknown input {}; this formula reads {}", .unknown.join(", "), .read.join(", "))]
    Unknown {
        /// The unknown inputs.
        unknown: Vec<String>,
        /// The inputs of the formula.
        read: Vec<String>,
    },
    /// Another case has the same `id`.
    #[error("an earlier case has this id")]
    SameId,
    /// A scheme's name.
    #[error(transparent)]
    Scheme(#[from] UnknownScheme),
    /// A blend.
    #[error(transparent)]
    Blend(#[from] BlendError),
    /// A quantity that does not fit the firmware.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// Neither the document nor the catalogue has the motor.
    #[error(transparent)]
    Motor(#[from] UnknownMotor),
}
