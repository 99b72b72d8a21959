//! Records the last motion of a shaft from encoder samples: when it was, its direction, its speed and its load.
//!
//! A shaft that rests on an edge of the encoder toggles by one count. An encoder with one broken wire toggles by one
//! count at any position. So a *motion* is a step of two counts or more: out of a dead band of one count to either
//! side.

use crate::motion::Reading;

/// Limits of what counts as a motion, and as a steady motion.
struct MotionLimits {
    /// Time after a motion in which samples are not evaluated, in µs. It saves processor time.
    pause_us: u32,
    /// Longest time between two motions of one run, in µs.
    gap_us: u32,
    /// Shortest run in one direction that is steady, in µs. A motor that a load threw does not turn that long.
    steady_us: u32,
    /// Fewest counts of one speed measurement.
    window_counts: u32,
    /// Shortest time of one speed measurement, in µs.
    window_us: u32,
    /// Least ratio of a measured speed to the speed measured before. A motor below it is about to stop.
    speed_ratio: f32,
}

const LIMITS: MotionLimits = MotionLimits {
    pause_us: 4_000,
    gap_us: 50_000,
    steady_us: 200_000,
    window_counts: 4,
    window_us: 48_000,
    speed_ratio: 0.75,
};

/// The last motion of a shaft, and the run that it belongs to.
///
/// A run is a series of motions in one direction without a long gap. Its speed is measured in windows. Times are the
/// low 32 bits of microseconds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct LastMotion {
    /// Position in the middle of the dead band, in counts.
    centre: i32,
    /// Time of the newest sample.
    sampled_at: u32,
    /// Time of the last motion.
    moved_at: u32,
    /// Time at which the present run began.
    run_began_at: u32,
    /// Time at which the present window began.
    window_began_at: u32,
    /// Counts in the present window.
    window_counts: u32,
    /// Speed in the last complete window, in counts/s; 0 before the first.
    speed_cps: f32,
    /// Speed in the window before the last complete one, in counts/s.
    speed_before_cps: f32,
    /// Direction of the last motion; `None` before the first.
    clockwise: Option<bool>,
    /// Disturbance at the end of the last complete window, in counts/s².
    disturbance_cps2: f32,
    /// Disturbance at the end of the window before the last complete one, in counts/s².
    disturbance_before_cps2: f32,
    /// True if there was a motion since the last call of [`take_moved`](Self::take_moved).
    moved: bool,
}

/// A steady motion that came before a silence of the encoder.
#[derive(Clone, Copy, Debug)]
pub(super) struct SteadyMotion {
    /// Speed in counts/s; the lowest recent measurement.
    pub(super) speed_cps: f32,
    /// Disturbance in counts/s²: acceleration by everything but the bridge, positive in the direction of motion.
    pub(super) disturbance_cps2: f32,
    /// Drive voltage at the last motion, positive in the direction of motion.
    pub(super) drive_volts: f32,
}

impl LastMotion {
    /// Takes a sample. `disturbance` computes the estimated disturbance in counts/s²; it is called once a window.
    pub(super) fn sample(&mut self, reading: &Reading, disturbance: impl FnOnce() -> f32) {
        self.sampled_at = reading.at.get() as u32;
        if self.silent_us() < LIMITS.pause_us {
            return;
        }
        let away = reading.position.wrapping_sub(self.centre);
        if !(-1..=1).contains(&away) {
            self.centre = reading.position.wrapping_sub(away.signum());
            self.record(away > 0, away.unsigned_abs() - 1, disturbance);
        }
    }

    /// Records a motion at the time of the newest sample. `counts` is its distance.
    fn record(&mut self, clockwise: bool, counts: u32, disturbance: impl FnOnce() -> f32) {
        let now = self.sampled_at;
        if self.clockwise != Some(clockwise) || self.silent_us() > LIMITS.gap_us {
            (self.run_began_at, self.window_began_at, self.window_counts) = (now, now, 0);
            (self.clockwise, self.speed_before_cps, self.speed_cps) = (Some(clockwise), 0.0, 0.0);
        } else {
            // The sum may wrap after a corrupt sample: this makes one window's speed wrong.
            self.window_counts = self.window_counts.wrapping_add(counts);
            let window_us = now.wrapping_sub(self.window_began_at);
            if self.window_counts >= LIMITS.window_counts && window_us >= LIMITS.window_us {
                (self.speed_before_cps, self.speed_cps) =
                    (self.speed_cps, per_second(self.window_counts, window_us));
                (self.window_began_at, self.window_counts) = (now, 0);
                (self.disturbance_before_cps2, self.disturbance_cps2) =
                    (self.disturbance_cps2, disturbance());
            }
        }
        self.moved_at = now;
        self.moved = true;
    }

    /// Returns true if there was a motion since the last call.
    pub(super) const fn take_moved(&mut self) -> bool {
        core::mem::replace(&mut self.moved, false)
    }

    /// Time from the last motion, or from [`forget`](Self::forget), to the newest sample, in µs.
    pub(super) const fn silent_us(&self) -> u32 {
        self.sampled_at.wrapping_sub(self.moved_at)
    }

    /// Direction of the last motion; `None` before the first.
    pub(super) const fn clockwise(&self) -> Option<bool> {
        self.clockwise
    }

    /// The steady motion before the silence, with the drive voltage (positive clockwise) at its end. `None` if the
    /// motor turned in the other direction, not long enough, or was about to stop.
    pub(super) fn steady(&self, clockwise: bool, drive_volts: f32) -> Option<SteadyMotion> {
        let run_us = self.moved_at.wrapping_sub(self.run_began_at);
        if self.clockwise != Some(clockwise) || run_us < LIMITS.steady_us {
            return None;
        }
        // The motor may have become slower since the last complete window. The end of the incomplete window is left
        // out: an encoder toggles when a wire breaks.
        let window_us = self.moved_at.wrapping_sub(self.window_began_at).saturating_sub(2 * LIMITS.pause_us);
        let speed_cps = if self.window_counts > 0 && window_us > 0 {
            self.speed_cps.min(per_second(self.window_counts.saturating_add(1), window_us))
        } else {
            self.speed_cps
        };
        let signed = |clockwise_value: f32| if clockwise { clockwise_value } else { -clockwise_value };
        // The newest disturbance is wrong if the encoder already lost counts in the last window.
        let disturbance_cps2 = signed(self.disturbance_before_cps2);
        let steady = SteadyMotion { speed_cps, disturbance_cps2, drive_volts: signed(drive_volts) };
        (speed_cps >= LIMITS.speed_ratio * self.speed_before_cps).then_some(steady)
    }

    /// Starts the silence and the run at the newest sample, so that no steady motion is left. Keeps direction and dead
    /// band.
    pub(super) const fn forget(&mut self) {
        (self.run_began_at, self.moved_at) = (self.sampled_at, self.sampled_at);
    }
}

/// The mean speed in counts/s, of a number of counts in a number of microseconds.
fn per_second(counts: u32, micros: u32) -> f32 {
    1e6 * counts as f32 / micros as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::Micros;

    /// The record after these positions, one each millisecond.
    fn record_of(positions: impl Iterator<Item = i32>) -> LastMotion {
        let mut motion = LastMotion::default();
        for (at, position) in (1u64..).map(|ms| Micros::new(1_000 * ms)).zip(positions) {
            motion.sample(&Reading { position, edge_at: at, at }, || 0.0);
        }
        motion
    }

    /// The record after 1 s at a speed of `cps`, and then `ms` of toggling by one count.
    fn silent_after(cps: f64, ms: i32) -> LastMotion {
        let turning = (0..1_000).map(move |ms| (cps * f64::from(ms) / 1e3) as i32);
        let last = (cps * 0.999) as i32;
        record_of(turning.chain((0..ms).map(move |ms| last - ms % 2)))
    }

    #[test]
    fn toggling_by_one_count_to_either_side_is_no_motion() {
        let mut motion = record_of([0, 1, 0, -1].into_iter().cycle().take(500));
        assert!(!motion.take_moved());
        assert_eq!(motion.clockwise(), None);
    }

    #[test]
    fn steady_motion_before_a_silence_is_recorded_with_its_speed() {
        for cps in [60.0, -60.0, 1_000.0, -5_000.0] {
            let motion = silent_after(cps, 80);
            let speed = f64::from(motion.steady(cps > 0.0, 0.0).map_or(0.0, |steady| steady.speed_cps));
            assert!((speed / cps.abs() - 1.0).abs() < 0.2, "{speed} of {cps}");
            assert!(motion.steady(cps < 0.0, 0.0).is_none());
            // The last count may be some time before the silence, and the first toggle may be a motion.
            let silent_ms = motion.silent_us() / 1_000;
            assert!((74..=82 + (1e3 / cps.abs()) as u32).contains(&silent_ms), "{silent_ms} ms of {cps}");
        }
    }

    #[test]
    fn a_motor_that_was_about_to_stop_or_had_just_started_was_not_steady() {
        // From 400 counts/s to rest within 0.1 s.
        let braked = |ms: i32| {
            let t = f64::from(ms.clamp(500, 600) - 500) / 1e3;
            (0.4 * f64::from(ms.min(500)) + 400.0 * (t - 5.0 * t * t)) as i32
        };
        assert!(record_of((0..700).map(braked)).steady(true, 0.0).is_none());
        assert!(record_of((0..300).map(|ms| ms.clamp(100, 200))).steady(true, 0.0).is_none());
    }
}
