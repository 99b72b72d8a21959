//! Estimates how fast a demanded speed changes while a host *streams* set-points: a speed every few milliseconds, as
//! from a joystick, a ramp or another controller.
//!
//! The motor reaches a streamed speed late. The set-point waits for the next tick, by T / 2 on average. The motor then
//! needs a tick to reach the speed, and meanwhile the speed of the host has changed. With the slope of the stream the
//! motor has at each tick's end the speed that the stream had at the tick's start:
//!
//! ```text
//! speed    slope ──┐       ● target
//!                  ▼   ╱   :             at the tick's end: target + slope * (age + T / 2)
//!                ●        :              T / 2: the mean time for which a set-point waits for its tick
//!            ●   :  interval :  age  :
//! ────────────────────────────────── time
//! ```
//!
//! In the formula the age is at most the mean interval. A demanded speed that stays, or that changes once, has the
//! slope 0.

use super::samples;
use crate::units::Micros;
use crate::units::single::at_most;

/// Longest interval between two set-points of a stream, in ms.
const LONGEST_INTERVAL_MS: u32 = 100;
/// Largest ratio of two consecutive changes of a stream. Changes with a larger ratio are steps.
const LARGEST_RATIO: f32 = 3.0;

/// Age of a set-point at a tick's end above which the stream has ended, as a multiple of the mean interval. The slope
/// is then 0.
const LATEST_INTERVALS: f32 = 1.5;

/// The stream of demanded speeds of one motor. The default is a demand of 0 that has not changed.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Stream {
    /// Demanded speed in counts/s.
    target: f32,
    /// Last change of the demanded speed, in counts/s.
    change: f32,
    /// Time at which the demanded speed last changed.
    changed_at: Micros,
    /// Time between the last two changes, in ms.
    interval_ms: u32,
    /// Mean of the last two intervals, in ms.
    mean_interval_ms: f32,
    /// Slope of the demanded speed over the last two intervals, in counts/s per ms; 0 if the last two changes are not
    /// of one stream.
    slope: f32,
}

/// A demanded speed at a tick.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    /// Demanded speed of the last set-point, in counts/s.
    pub(super) demanded: f32,
    /// Speed that the motor should have at the tick's end, in counts/s. This speed has the sign of `demanded`, or is 0.
    pub(super) end: f32,
    /// Change of the demanded speed within the tick, in counts/s.
    pub(super) change: f32,
    /// True if the demanded speed is unchanged since the last tick.
    pub(super) is_old: bool,
}

impl Stream {
    /// Updates the stream with the demanded speed of the tick at `now`, in counts/s. Returns the target of the tick.
    pub(super) fn step(&mut self, target: f32, now: Micros, period_ms: u32) -> Target {
        let mut age_ms = samples(self.changed_at, now);
        let change = target - self.target;
        let is_old = change == 0.0;
        if !is_old {
            let both_ms = age_ms.saturating_add(self.interval_ms) as f32;
            self.slope =
                if self.continues(target, change, age_ms) { (change + self.change) / both_ms } else { 0.0 };
            (self.target, self.change, self.mean_interval_ms) = (target, change, 0.5 * both_ms);
            (self.changed_at, self.interval_ms) = (now, age_ms);
            age_ms = 0;
        }
        let (age, period) = (age_ms as f32, period_ms as f32);
        let is_late = age + period > LATEST_INTERVALS * self.mean_interval_ms;
        let slope = if is_late { 0.0 } else { self.slope };
        let end = target + slope * (at_most(age, self.mean_interval_ms) + 0.5 * period);
        let end = if end * target < 0.0 { 0.0 } else { end };
        Target { demanded: target, end, change: slope * period, is_old }
    }

    /// True if this change of the demanded speed and the last change, `age_ms` ago, are of one stream. A speed of 0 ends
    /// a stream.
    fn continues(&self, target: f32, change: f32, age_ms: u32) -> bool {
        let (last, next) = (self.change.abs(), change.abs());
        target != 0.0
            && age_ms.max(self.interval_ms) <= LONGEST_INTERVAL_MS
            && self.change * change > 0.0
            && next.max(last) <= LARGEST_RATIO * next.min(last)
    }
}
