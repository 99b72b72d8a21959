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
//! the speed is near its set-point and the set-point is constant. Old swings lose weight with every tick. With a wrong
//! load, inertia or resistance the current swings less, or stops swinging after some time.

/// Limits of the detector. The values are from simulations of 558 set-points and two sets of random scenarios.
/// `docs/decisions/0024-a-back-emf-that-is-too-high.md` has figures of such simulations.
struct Limits {
    /// Largest part, in V, of a steady motor's requested voltage that corrects the error of the speed.
    correction_volts: f32,
    /// Least back EMF, in V, of a steady motor. A slower motor is not examined.
    emf_volts: f32,
    /// Least swing of the current between two changes of its level, as a voltage, in V.
    swing_volts: f32,
    /// Share of the weight of old swings that remains after a tick.
    remaining: f32,
    /// Weighted number of swings above which a motor hunts.
    swings: f32,
}

const LIMITS: Limits =
    Limits { correction_volts: 1.0, emf_volts: 0.5, swing_volts: 0.1, remaining: 0.97, swings: 2.0 };

/// A tick of a motor with a demanded speed. Voltages are in V.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tick {
    /// True if the demanded speed is unchanged since the last tick.
    pub(super) target_is_old: bool,
    /// Part of the requested voltage that corrects the error of the speed.
    pub(super) correction_volts: f32,
    /// Back EMF, in V, positive clockwise.
    pub(super) emf_volts: f32,
    /// Requested voltage, in V.
    pub(super) volts: f32,
}

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

impl Hunting {
    /// Executes a tick. `boundary` computes the boundary, a current as a voltage in V, and is called only while the
    /// motor is steady and driven. Returns true at a change of level that shows that the motor hunts.
    pub(super) fn step(&mut self, tick: &Tick, boundary: impl FnOnce() -> f32) -> bool {
        let current = (tick.volts - tick.emf_volts) * 1.0f32.copysign(tick.emf_volts);
        let steady = tick.target_is_old
            && tick.correction_volts.abs() < LIMITS.correction_volts
            && tick.emf_volts.abs() > LIMITS.emf_volts;
        if !steady {
            *self = Self { swings: 0.0, low: current, high: current, ..*self };
            return false;
        }
        (self.low, self.high) = (self.low.min(current), self.high.max(current));
        self.swings *= LIMITS.remaining;
        let level = match current {
            ..0.0 => 0,
            _ if current < boundary() => 1,
            _ => 2,
        };
        if level == self.level {
            return false;
        }
        let swung = self.high - self.low > LIMITS.swing_volts;
        (self.level, self.low, self.high) = (level, current, current);
        self.swings += f32::from(u8::from(swung));
        swung && self.swings > LIMITS.swings
    }
}
