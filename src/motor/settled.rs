//! Decides whether a motor is at its target, by two terms that the whole project uses:
//!
//! * *Within tolerance*: the distance to the target is at most the tolerance. REV's protocol reports this state. The
//!   speed does not matter, so a motor that passes its target is within tolerance for a short time.
//! * *Settled*: within tolerance and slow, at every tick of a dwell. This hub's own report, groups, the client and the
//!   dashboard use this state.
//!
//! Both are false for a disabled motor and for a motor without a target position.

use crate::units::{CountsPerSecond, Period};

/// Dwell in milliseconds. A motor that leaves the tolerance or becomes faster before the end of the dwell has only
/// passed its target.
const DWELL_MS: u16 = 50;
/// Highest speed of a slow motor: two counts in 50 ms. The estimate may be wrong by one count, and a regulator that
/// holds a position may move the motor by another count.
const SLOW: CountsPerSecond = CountsPerSecond::new(40);

/// True if a position is within the tolerance of a target, by REV's definition: |target - position| <= tolerance, the
/// short way round the ring of 2^32 counts.
pub const fn within_tolerance(target: i32, position: i32, tolerance: u16) -> bool {
    target.wrapping_sub(position).unsigned_abs() <= tolerance as u32
}

/// Detects whether a motor, or a group of motors, has settled.
#[derive(Clone, Copy, Debug, Default)]
pub struct SettleDetector {
    /// Duration in ms of the last ticks without interruption at which the motor was within tolerance and slow.
    settling_ms: u16,
}

impl SettleDetector {
    /// Restarts the dwell, because the target has changed.
    pub const fn reset(&mut self) {
        self.settling_ms = 0;
    }

    /// Updates the detector at a tick. `within_tolerance` is true if the motor is within tolerance at this tick.
    /// Returns true if the motor has settled. The dwell is 50 ms, or one period if the period is longer.
    pub fn step(&mut self, within_tolerance: bool, velocity: CountsPerSecond, period: Period) -> bool {
        let slow = velocity.to_bits().unsigned_abs() <= SLOW.to_bits().unsigned_abs();
        // A period has at most 100 ms.
        let tick_ms = period.as_millis() as u16;
        self.settling_ms =
            if within_tolerance && slow { self.settling_ms.saturating_add(tick_ms) } else { 0 };
        // The dwell begins at the first tick within tolerance, so the period of this tick does not count.
        self.settling_ms >= DWELL_MS + tick_ms
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of a period in milliseconds and the number of ticks until the dwell is over.
    const TICKS: [(u32, usize); 4] = [(1, 50), (30, 2), (50, 1), (100, 1)];

    /// Executes a tick at a control period of `ms` milliseconds, with a speed in counts/s.
    fn step(detector: &mut SettleDetector, ms: u32, within_tolerance: bool, speed: i32) -> bool {
        let period = Period::from_millis(ms).unwrap_or_default();
        detector.step(within_tolerance, CountsPerSecond::new(speed), period)
    }

    #[test]
    fn a_position_is_within_tolerance_up_to_the_tolerance_either_way_and_across_the_ends() {
        for (target, position, tolerance, within) in [
            (100, 95, 5, true),
            (100, 105, 5, true),
            (100, 94, 5, false),
            (100, 106, 5, false),
            (7, 7, 0, true),
            (i32::MIN, i32::MAX, 1, true),
            (i32::MIN, i32::MAX - 1, 1, false),
            (i32::MIN, 0, u16::MAX, false),
        ] {
            assert_eq!(
                within_tolerance(target, position, tolerance),
                within,
                "{target} {position} {tolerance}"
            );
        }
    }

    #[test]
    fn a_motor_that_passes_its_target_at_speed_has_not_settled() {
        for (ms, _) in TICKS {
            for speed in [41, -41, 3_000] {
                let mut detector = SettleDetector::default();
                assert!((0..200).all(|_| !step(&mut detector, ms, true, speed)), "{ms} ms, {speed}");
            }
        }
    }

    #[test]
    fn a_slow_motor_settles_after_the_dwell_and_again_after_it_was_displaced_or_got_another_target() {
        for ((ms, ticks), speed) in TICKS.into_iter().flat_map(|ticks| [0, 40, -40].map(|cps| (ticks, cps))) {
            let settles_after_the_dwell = |detector: &mut SettleDetector| {
                assert!((0..ticks).all(|_| !step(detector, ms, true, speed)), "{ms} ms, {speed}");
                assert!((0..200).all(|_| step(detector, ms, true, speed)), "{ms} ms, {speed}");
            };
            for disturb in [
                |detector: &mut SettleDetector, ms| assert!(!step(detector, ms, false, 0)),
                |detector: &mut SettleDetector, ms| assert!(!step(detector, ms, true, -500)),
                |detector: &mut SettleDetector, _| detector.reset(),
            ] {
                let mut detector = SettleDetector::default();
                settles_after_the_dwell(&mut detector);
                disturb(&mut detector, ms);
                settles_after_the_dwell(&mut detector);
            }
        }
    }
}
