//! The bus as a host would want to see it, whether or not motors may run on it.

use super::limits::{Levels, Limits};
use super::{BATTERY_STALE_MICROS, Battery, Stage};
use crate::units::{Micros, Millivolts, Share};

/// In which of its ranges the bus is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BusState {
    /// The converter says nothing, or nothing new: motors coast.
    #[default]
    Silent,
    /// Below what is plausible: motors coast.
    TooLow,
    /// Nothing is drawn.
    Cut,
    /// Less is drawn.
    Derated,
    /// All is as asked.
    Quiet,
    /// Braking motors burn what they would return.
    Burning,
    /// The same, and the bus is above what they keep it below: something else lifts it.
    TooHigh,
}

/// What was seen last, and when.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Seen {
    /// As the converter measured it, plausible or not; `None` if it did not answer.
    pub measured: Option<Millivolts>,
    /// What that means.
    pub state: BusState,
    /// When it was measured.
    pub at: Micros,
}

impl Seen {
    /// Nothing yet.
    pub const NOTHING: Self = Self { measured: None, state: BusState::Silent, at: Micros::new(0) };

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

    /// The same, or that nothing new was seen for too long.
    #[must_use]
    pub fn by(self, now: Micros) -> Self {
        if now.since(self.at) <= BATTERY_STALE_MICROS { self } else { Self { at: self.at, ..Self::NOTHING } }
    }
}
