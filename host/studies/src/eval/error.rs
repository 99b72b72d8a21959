//! Errors of a case.

use motor_hub::model::catalogue::UnknownMotor;
use motor_hub::units::RangeError;
use simulated::scheme::{BlendError, UnknownScheme};

/// Why a case could not be answered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CaseError {
    /// The formula or an input is missing, unknown or out of range.
    #[error("{0}")]
    Input(String),
    /// The scheme is unknown.
    #[error(transparent)]
    Scheme(#[from] UnknownScheme),
    /// A blend is out of range, or given for a scheme that has none.
    #[error(transparent)]
    Blend(#[from] BlendError),
    /// A quantity does not fit the firmware.
    #[error(transparent)]
    Range(#[from] RangeError),
    /// Neither the document nor the catalogue has the motor.
    #[error(transparent)]
    Motor(#[from] UnknownMotor),
}

impl From<String> for CaseError {
    fn from(says: String) -> Self {
        Self::Input(says)
    }
}

impl From<&str> for CaseError {
    fn from(says: &str) -> Self {
        Self::Input(says.to_owned())
    }
}
