//! The last reading of the bus voltage and its meaning for motors, for reports to a host.

use super::limits::{Levels, Limits};
use super::{BATTERY_STALE_MICROS, Battery, DrawStage};
use crate::units::{Micros, Millivolts, Share};

/// What the last reading of the bus means for the motors. [`Levels`] has the voltages between the states.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum BusState {
    /// The converter does not answer, or its last reading is stale. Motors coast once the last plausible reading is
    /// stale.
    #[default]
    NoReading,
    /// The voltage is below [`Levels::min`]. After two such voltages in a row motors draw no current. Motors coast once
    /// the last plausible reading is stale.
    TooLow,
    /// The voltage fell to [`Levels::cutoff`] and is not back at [`Levels::derate`]. Motors may draw no current.
    Cutoff,
    /// The battery is low. Motors may draw a limited current.
    Derated,
    /// The battery is not low, and braking motors may return energy to the bus. After a low voltage the permitted
    /// current may still be rising, so this state does not imply a [quiet range](super::Supply::quiet).
    Quiet,
    /// Braking motors dissipate the energy that they would return to the bus.
    Dissipating,
    /// The voltage is above [`Levels::ceiling`]. Motors that dissipate keep the voltage below `ceiling`, so a source
    /// other than the motors raises the voltage.
    TooHigh,
}

impl BusState {
    /// Returns the name of the state, for documents and pages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoReading => "silent",
            Self::TooLow => "too-low",
            Self::Cutoff => "cut",
            Self::Derated => "derated",
            Self::Quiet => "quiet",
            Self::Dissipating => "dissipating",
            Self::TooHigh => "too-high",
        }
    }
}

/// The last reading of the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BusReading {
    /// Voltage as measured, plausible or not. `None` before the first reading, if the converter did not answer, or if
    /// [`as_of`](Self::as_of) found the reading stale.
    pub measured: Option<Millivolts>,
    /// State of the bus.
    pub state: BusState,
    /// Time of the measurement. 0 before the first reading.
    pub at: Micros,
}

impl BusReading {
    /// The state before the first reading.
    pub const INITIAL: Self = Self { measured: None, state: BusState::NoReading, at: Micros::new(0) };

    /// Creates a reading. `battery` is the result of [`Supply::step`](super::Supply::step) for this measurement.
    pub(super) fn new(
        limits: &Limits,
        measured: Option<Millivolts>,
        battery: Option<&Battery>,
        at: Micros,
    ) -> Self {
        let Levels { min, ceiling, .. } = limits.levels();
        let state = match (measured, battery) {
            (None, _) => BusState::NoReading,
            (Some(voltage), _) if voltage < min => BusState::TooLow,
            (Some(voltage), _) if voltage > ceiling => BusState::TooHigh,
            (_, Some(Battery { stage: DrawStage::Cutoff, .. })) => BusState::Cutoff,
            (_, Some(Battery { stage: DrawStage::Derated, .. })) => BusState::Derated,
            (_, Some(battery)) if battery.dissipate != Share::NONE => BusState::Dissipating,
            _ => BusState::Quiet,
        };
        Self { measured, state, at }
    }

    /// Returns the reading, or [`BusState::NoReading`] without a voltage if the reading is older than
    /// [`BATTERY_STALE_MICROS`] at `now`.
    #[must_use]
    pub fn as_of(self, now: Micros) -> Self {
        if now.since(self.at) <= BATTERY_STALE_MICROS { self } else { Self { at: self.at, ..Self::INITIAL } }
    }
}
