//! Set-points of a motor.

use super::within_tolerance;
use crate::regulator::Reference;
use crate::units::{Control, CountsPerSecond, Milliamperes};

/// Set-point of a motor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Setpoint {
    /// The motor is disabled, and the bridge is open.
    #[default]
    Disabled,
    /// The host no longer sends packets. The bridge is open or brakes, by the motor's setting
    /// [`OnFault`](super::OnFault).
    FailSafe,
    /// Open loop: 9/8 or 6/2 with this share of the control range as duty, whatever the speed. At 0 the motor brakes
    /// or coasts, by the setting [`ZeroPower`](super::ZeroPower).
    ConstantPower(Control),
    /// Constant current, and so constant torque, while the motor is slower than the speed limit.
    Current {
        /// Mean current of the winding; positive drives CW.
        current: Milliamperes,
        /// Largest speed in the direction of the current; the sign does not matter. At this speed the current falls to
        /// the current that keeps the speed. If a load drives the motor faster, the motor brakes with at most
        /// `current`.
        speed_limit: CountsPerSecond,
    },
    /// Regulated velocity: the motor turns at this speed. At 0 the motor is held or coasts, by the setting
    /// [`ZeroPower`](super::ZeroPower).
    Velocity(CountsPerSecond),
    /// Regulated position: the motor goes to a position and holds the position.
    Position {
        /// Target position in counts. The motor takes the shorter direction round the ring of 2^32 counts.
        target: i32,
        /// Largest distance to the target, in counts, at which the motor is [within
        /// tolerance](super::within_tolerance).
        tolerance: u16,
        /// Largest speed towards the target; the sign does not matter.
        speed_limit: CountsPerSecond,
    },
    /// [Identification](crate::regulator::identify) of motor and load by a short motion. The motor coasts before and
    /// after.
    Identify {
        /// Largest travel of the motion in either direction, in counts. A smaller limit makes the motion shorter.
        travel_limit: u32,
    },
    /// Regulated position in a [group](crate::group): the motor follows this reference. The hub sets a new reference
    /// at every tick. Without a new reference the motor stays near the last reference.
    Follow(Reference),
}

impl Setpoint {
    /// True if a regulator computes the bridge's command.
    pub(super) const fn is_regulated(self) -> bool {
        matches!(self, Self::Velocity(_) | Self::Position { .. } | Self::Follow(_))
    }

    /// True if the command needs no encoder and no tick: a disabled motor, fail-safe and constant power. A constant
    /// current needs the speed, and so the encoder.
    pub const fn is_direct(self) -> bool {
        matches!(self, Self::Disabled | Self::FailSafe | Self::ConstantPower(_))
    }

    /// True if `next` continues the motion of a motor at this position, in counts: the kind of the set-point and the
    /// requested direction stay. Hosts stream set-points that continue a motion.
    pub(super) fn continues_as(self, next: Self, position: i32) -> bool {
        let same = |before: i32, after: i32| before != 0 && before.signum() == after.signum();
        match (self, next) {
            (Self::Velocity(before), Self::Velocity(after)) => same(before.to_bits(), after.to_bits()),
            (Self::Position { target: before, .. }, Self::Position { target: after, .. }) => {
                same(before.wrapping_sub(position), after.wrapping_sub(position))
            }
            // The reference of a group stands still while a member lags. A reference that stands still continues the
            // motion. A reference that moves again begins a motion.
            (Self::Follow(before), Self::Follow(after)) => {
                after.next == CountsPerSecond::ZERO || same(before.next.to_bits(), after.next.to_bits())
            }
            _ => false,
        }
    }

    /// True if `position` is [within tolerance](within_tolerance) of a target position; false for a set-point without a
    /// target position, as in a group.
    pub(super) const fn is_within_tolerance(self, position: i32) -> bool {
        match self {
            Self::Position { target, tolerance, .. } => within_tolerance(target, position, tolerance),
            _ => false,
        }
    }
}
