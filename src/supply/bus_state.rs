//! The bus as a host sees it: the last reading and its range, whether or not motors may run.

use super::limits::{Levels, Limits};
use super::{BATTERY_STALE_MICROS, Battery, Stage};
use crate::units::{Micros, Millivolts, Share};

/// The range in which the bus is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BusState {
    /// The converter does not answer, or its last reading is stale. Motors coast.
    #[default]
    Silent,
    /// The voltage is below [`Levels::min`]. Motors coast once the last plausible reading is stale.
    TooLow,
    /// No current may be drawn.
    Cut,
    /// The current is limited.
    Derated,
    /// The battery is not low, and braking motors may return energy.
    Quiet,
    /// Braking motors dissipate the energy that they would return.
    Burning,
    /// The voltage is above [`Levels::burn_all`] although braking motors dissipate: another source lifts the bus.
    TooHigh,
}

/// The last reading of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusReading {
    /// Voltage as measured, plausible or not; `None` if the converter did not answer.
    pub measured: Option<Millivolts>,
    /// The range in which the bus was.
    pub state: BusState,
    /// Time of the measurement.
    pub at: Micros,
}

impl BusReading {
    /// The state before the first reading.
    pub const NOTHING: Self = Self { measured: None, state: BusState::Silent, at: Micros::new(0) };

    /// Finds the range of a reading; `battery` is what [`Supply::step`](super::Supply::step) made of the reading.
    pub(super) fn new(
        limits: &Limits,
        measured: Option<Millivolts>,
        battery: Option<&Battery>,
        at: Micros,
    ) -> Self {
        let Levels { min, burn_all, .. } = limits.levels();
        let state = match (measured, battery) {
            (None, _) => BusState::Silent,
            (Some(voltage), _) if voltage < min => BusState::TooLow,
            (Some(voltage), _) if voltage > burn_all => BusState::TooHigh,
            (_, Some(Battery { stage: Stage::Cut, .. })) => BusState::Cut,
            (_, Some(Battery { stage: Stage::Derated, .. })) => BusState::Derated,
            (_, Some(battery)) if battery.burn != Share::NONE => BusState::Burning,
            _ => BusState::Quiet,
        };
        Self { measured, state, at }
    }

    /// Returns the reading, or [`BusState::Silent`] if the reading is older than [`BATTERY_STALE_MICROS`].
    #[must_use]
    pub fn by(self, now: Micros) -> Self {
        if now.since(self.at) <= BATTERY_STALE_MICROS { self } else { Self { at: self.at, ..Self::NOTHING } }
    }
}
