//! Inputs and outputs of both regulators, model and PID.

use crate::braking::{Modulator, OperatingPoint};
use crate::settings::Settings;
use crate::units::{Control, CountsPerSecond, Period, Voltage};

/// Kind of a regulator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Kind {
    /// Regulation by the motor's own equation.
    #[default]
    Model,
    /// Regulation by proportional, integral and derivative action.
    Pid,
}

impl Kind {
    /// The kind as a word for people and programs.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Pid => "PID",
        }
    }

    /// The kind of regulator that the settings select.
    pub const fn of(settings: &Settings) -> Self {
        match settings.coefficients {
            None => Self::Model,
            Some(_) => Self::Pid,
        }
    }
}

/// Demand on a regulated motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// The motor turns at this speed.
    Velocity(CountsPerSecond),
    /// The motor follows a moving position.
    Follow(Reference),
    /// The motor goes to a position and stays there.
    Position {
        /// Target position in counts.
        target: i32,
        /// Largest speed towards the target; the sign does not matter.
        speed_limit: CountsPerSecond,
    },
}

/// Position and speed that a motor of a group should have at this tick.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reference {
    /// Whole counts of the position.
    pub position: i32,
    /// Fraction of the position towards the next count, in steps of 2^-16 counts.
    pub fraction: u16,
    /// Speed at this tick.
    pub speed: CountsPerSecond,
    /// Speed at the next tick.
    pub next: CountsPerSecond,
    /// Largest speed at which a motor approaches the reference, relative to the reference; not negative.
    pub speed_limit: CountsPerSecond,
}

impl Reference {
    /// True if the reference stands still now and at the next tick.
    pub(super) fn is_still(&self) -> bool {
        self.speed == CountsPerSecond::ZERO && self.next == CountsPerSecond::ZERO
    }

    /// Distance from a position to the reference, in counts.
    pub(super) fn from(&self, position: i32) -> f32 {
        self.position.wrapping_sub(position) as f32 + f32::from(self.fraction) / 65_536.0
    }
}

/// Inputs of a regulator at a tick, besides its demand.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a> {
    /// Settings of the motor.
    pub settings: &'a Settings,
    /// Maps control values to voltages and back.
    pub modulator: &'a Modulator,
    /// Control period.
    pub period: Period,
    /// Back EMF and battery voltage.
    pub at: OperatingPoint,
    /// Largest voltage that all limits of current and power allow at standstill, in V; infinite without a limit. A moving
    /// motor may brake with at least this voltage beyond its back EMF.
    pub standstill_volts: f32,
    /// True while braking motors dissipate energy, because the bus cannot take it. Burn pulses then replace the requested
    /// voltage of a braking motor.
    pub dissipates: bool,
}

/// Request of a regulator to the bridge.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// A voltage across the motor.
    Voltage(Voltage),
    /// A control value: the output of PID without feed-forward.
    Control(Control),
}

/// Output of a regulator at a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// Request to the bridge.
    pub effort: Effort,
    /// Speed that the request should reach.
    pub speed: CountsPerSecond,
    /// True if the speed hunts, because the back EMF constant in force is too high. Only the model regulator finds
    /// this.
    pub hunts: bool,
}
