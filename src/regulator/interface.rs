//! What goes into a regulator and what comes out of it, whichever it is.

use super::{Coefficients, Dynamics};
use crate::braking::{Modulator, OperatingPoint};
use crate::units::{Acceleration, Control, CountsPerSecond, EmfConstant, Voltage};

/// What a regulator is told once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Config {
    /// Back EMF per speed.
    pub emf: EmfConstant,
    /// The motor and its load, if known.
    pub dynamics: Option<Dynamics>,
    /// Coefficients of a host's own: the PID runs with them, whatever is known.
    pub coefficients: Option<Coefficients>,
    /// Largest acceleration, of a motor that is known.
    pub acceleration: Option<Acceleration>,
}

/// Which of the two regulates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Kind {
    /// By the motor's own equation.
    Model,
    /// By proportional, integral and derivative action.
    Pid,
}

/// What a regulated motor is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Demand {
    /// Turn at this speed.
    Velocity(CountsPerSecond),
    /// Be at a place that moves.
    Follow(Reference),
    /// Go to a position and stay there.
    Position {
        /// Counts.
        target: i32,
        /// Magnitude of the speed on the way; the sign does not matter.
        speed_limit: CountsPerSecond,
    },
}

/// Where a motor should be at this tick, and how fast, as others set it whom it follows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Reference {
    /// Counts.
    pub position: i32,
    /// How far on towards the next count, in 2^-16 counts.
    pub fraction: u16,
    /// Speed now.
    pub speed: CountsPerSecond,
    /// Speed at the next tick.
    pub next: CountsPerSecond,
}

impl Reference {
    /// It does not move.
    pub(super) fn stands(&self) -> bool {
        self.speed == CountsPerSecond::ZERO && self.next == CountsPerSecond::ZERO
    }

    /// Counts from a position to it.
    pub(super) fn from(&self, position: i32) -> f32 {
        self.position.wrapping_sub(position) as f32 + f32::from(self.fraction) / 65_536.0
    }
}

/// What a regulator needs to know of the bridge at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Stage<'a> {
    /// Maps control values to voltages and back.
    pub modulator: &'a Modulator,
    /// Speed and battery voltage.
    pub at: OperatingPoint,
}

/// What a regulator requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// This voltage of the motor.
    Voltage(Voltage),
    /// What this control value means: the output of PID without feed-forward.
    Control(Control),
}

/// The output of a regulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Output {
    /// The request.
    pub effort: Effort,
    /// The speed that it is for.
    pub speed: CountsPerSecond,
}
