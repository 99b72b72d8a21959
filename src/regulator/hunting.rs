//! Detects that a speed *hunts*, because the back EMF constant in force is higher than the motor's back EMF constant.
//!
//! With too high a constant the [duty rule](mod@crate::braking::linear_current) expects a discontinuous current where
//! the current is already continuous. The same change of duty then makes several times the expected change of
//! current. The current swings between almost 0 and a current beyond the *boundary*. Up to the boundary the current
//! is discontinuous:
//!
//! ```text
//!              braking  |  discontinuous  |  continuous
//!   level         0     |        1        |      2
//!             ----------+-----------------+------------>  requested current in the direction of motion
//!                       0              boundary
//! ```
//!
//! The detector counts the changes of this level at which the current has swung far enough. Changes count only while
//! the speed is near its set-point, the set-point is constant, and no burn pulses replace the requested current. Old
//! swings lose weight with every tick. With a wrong load, inertia or resistance the current swings less, or stops
//! swinging after some time.

use super::Context;
use super::stream::Target;
use crate::units::Voltage;

/// The detector of one motor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hunting {
    /// Level of the current at the last tick.
    level: u8,
    /// Weighted number of swings. Old swings have less weight.
    swings: f32,
    /// Lowest current since the last change of level, as a voltage, in V.
    low: f32,
    /// Highest current since the last change of level, as a voltage, in V.
    high: f32,
}

/// Limits of the detector. The values are from simulations of 558 set-points and two sets of random scenarios.
/// `docs/decisions/0024-a-back-emf-that-is-too-high.md` has figures of such simulations.
impl Hunting {
    /// Largest part, in V, of a steady motor's requested voltage that corrects the error of the speed.
    const LARGEST_CORRECTION_VOLTS: f32 = 1.0;
    /// Least back EMF, in V, of a steady motor. A slower motor is not examined.
    const LEAST_EMF_VOLTS: f32 = 0.5;
    /// Least swing of the current between two changes of its level, as a voltage, in V.
    const LEAST_SWING_VOLTS: f32 = 0.1;
    /// Share of the weight of old swings that remains after a tick.
    const REMAINING_SHARE: f32 = 0.97;
    /// Weighted number of swings above which a motor hunts.
    const MOST_SWINGS: f32 = 2.0;
}

impl Hunting {
    /// Executes a tick of a motor with a demanded speed. `requested` is the requested voltage, and `correction_volts` is
    /// the part of this voltage, in V, that corrects the error of the speed. `emf_volts` is the back EMF in V, positive
    /// clockwise. Returns true at a change of level that shows that the motor hunts.
    pub(super) fn step(
        &mut self,
        target: &Target,
        requested: Voltage,
        correction_volts: f32,
        emf_volts: f32,
        context: &Context<'_>,
    ) -> bool {
        let current = (requested.to_volts() - emf_volts) * 1.0f32.copysign(emf_volts);
        let steady = target.is_old
            && !context.dissipates
            && correction_volts.abs() < Self::LARGEST_CORRECTION_VOLTS
            && emf_volts.abs() > Self::LEAST_EMF_VOLTS;
        if !steady {
            *self = Self { swings: 0.0, low: current, high: current, ..*self };
            return false;
        }
        (self.low, self.high) = (self.low.min(current), self.high.max(current));
        self.swings *= Self::REMAINING_SHARE;
        let level = match current {
            ..0.0 => 0,
            _ if current < context.modulator.discontinuous_volts(context.at, requested) => 1,
            _ => 2,
        };
        if level == self.level {
            return false;
        }
        let swung = self.high - self.low > Self::LEAST_SWING_VOLTS;
        (self.level, self.low, self.high) = (level, current, current);
        self.swings += f32::from(u8::from(swung));
        swung && self.swings > Self::MOST_SWINGS
    }
}
