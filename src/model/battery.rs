//! A battery: a voltage source with an internal resistance. The battery takes current back.
//!
//! ```
//! use motor_hub::model::battery::Battery;
//! use motor_hub::model::si::{Amps, Ohms, Volts};
//!
//! let battery = Battery { emf: Volts(12.5), resistance: Ohms(0.1) };
//! assert_eq!(battery.voltage(Amps(5.0)), Volts(12.0));
//! assert_eq!(battery.voltage(Amps(-5.0)), Volts(13.0));
//! ```

use super::si::{Amps, Ohms, Volts};

/// A voltage source with internal resistance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Battery {
    /// Voltage without load.
    pub emf: Volts,
    /// Internal resistance with the wiring, at least 0.
    pub resistance: Ohms,
}

impl Battery {
    /// Returns the voltage at the terminals while `current` leaves the battery, at least 0.
    ///
    /// A negative current charges the battery and raises the voltage above [`Battery::emf`].
    #[must_use]
    pub fn voltage(&self, current: Amps) -> Volts {
        Volts((self.emf.0 - self.resistance.0 * current.0).max(0.0))
    }
}
