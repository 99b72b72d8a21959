//! What a motor is asked to do.

use super::within_tolerance;
use crate::regulator::Reference;
use crate::units::{Control, CountsPerSecond, Milliamperes};

/// What a motor is asked to do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Setpoint {
    /// Nothing: the bridge is open.
    #[default]
    Disabled,
    /// Nothing, and not because somebody wants that: whoever told it what to do is gone. The bridge is open or
    /// brakes, as the motor's settings say of a fault.
    FailSafe,
    /// Open loop: 9/8 or 6/2 at this share of the control range, whatever the speed.
    ConstantPower(Control),
    /// A constant current, so a constant torque, while the motor is slower than the limit.
    Current {
        /// Mean current of the winding; positive drives CW.
        current: Milliamperes,
        /// Largest speed in the direction of the current; the sign does not matter. At this speed the current falls to what
        /// keeps the speed; a motor that a load drives faster brakes with at most the current.
        speed_limit: CountsPerSecond,
    },
    /// Regulated velocity.
    Velocity(CountsPerSecond),
    /// Regulated position: a position loop above the velocity loop.
    Position {
        /// Where to go, in counts, the short way round the ring of 2^32 of them.
        target: i32,
        /// Largest distance to the target, in counts, at which the motor is [within
        /// tolerance](super::within_tolerance).
        tolerance: u16,
        /// Magnitude of the speed on the way; the sign does not matter.
        speed_limit: CountsPerSecond,
    },
    /// A short motion from which the hub learns how motor and load answer to a voltage: see
    /// [`identify`](crate::regulator::identify). It coasts before and after.
    Identify {
        /// Counts, either way, that it may take at most; less makes the motion shorter.
        travel_limit: u32,
    },
    /// Regulated to be where its group wants it at this tick. The hub sets it, every tick, of the members of a
    /// [group](crate::group); a motor that nobody leads stays near the reference.
    Together(Reference),
}

impl Setpoint {
    /// True if a regulator stands between it and the bridge.
    pub(super) const fn is_regulated(self) -> bool {
        matches!(self, Self::Velocity(_) | Self::Position { .. } | Self::Together(_))
    }

    /// True if the bridge may be told at once: there is nothing to regulate, and nothing to learn.
    pub const fn is_direct(self) -> bool {
        matches!(self, Self::Disabled | Self::FailSafe | Self::ConstantPower(_))
    }

    /// True in regulated position while `position` is [within tolerance](within_tolerance).
    pub(super) const fn is_within_tolerance(self, position: i32) -> bool {
        match self {
            Self::Position { target, tolerance, .. } => within_tolerance(target, position, tolerance),
            _ => false,
        }
    }
}
