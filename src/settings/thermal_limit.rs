//! Thermal limit of a motor.

use crate::units::RangeError;

/// Thermal limit of a motor's winding: its continuous current, and the time constants of winding and case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ThermalLimit {
    /// Continuous current, in mA.
    continuous_ma: u16,
    /// Time constant of the winding, in s.
    winding_s: u16,
    /// Time constant of the case, in s.
    case_s: u16,
}

impl ThermalLimit {
    /// Usual time constant of a winding, in s, for a motor whose time constant is unknown.
    pub const USUAL_WINDING_S: u16 = 20;
    /// Usual time constant of a case, in s, for a motor whose time constant is unknown.
    pub const USUAL_CASE_S: u16 = 600;

    /// Creates a limit from the continuous current in mA, and the time constants of winding and case in s.
    ///
    /// # Errors
    /// Fails with [`RangeError::Thermal`] if an argument is 0.
    pub const fn new(continuous_ma: u16, winding_s: u16, case_s: u16) -> Result<Self, RangeError> {
        if continuous_ma == 0 || winding_s == 0 || case_s == 0 {
            return Err(RangeError::Thermal);
        }
        Ok(Self { continuous_ma, winding_s, case_s })
    }

    /// The continuous current: 1 to 65 535 mA.
    pub const fn continuous_ma(&self) -> u16 {
        self.continuous_ma
    }

    /// The time constant of the winding: 1 to 65 535 s.
    pub const fn winding_s(&self) -> u16 {
        self.winding_s
    }

    /// The time constant of the case: 1 to 65 535 s.
    pub const fn case_s(&self) -> u16 {
        self.case_s
    }

    /// The continuous current in A.
    pub(crate) fn continuous_amperes(&self) -> f32 {
        f32::from(self.continuous_ma) / 1000.0
    }
}
