//! Decides whether a motor is at its target, by two terms that the whole project uses:
//!
//! * *Within tolerance*: the distance to the target is at most the tolerance. Hosts of REV's protocol read this. The
//!   speed does not matter, so a motor that passes its target is within tolerance for a short time.
//! * *Settled*: within tolerance and slow, at every tick of a dwell. This hub's own report, groups, the client and the
//!   dashboard use this.
//!
//! Both are false for a disabled motor and for a motor without a target position.

use crate::units::{CountsPerSecond, Period};

/// Dwell in milliseconds. A motor that leaves the tolerance or becomes faster before the end of the dwell has only
/// passed its target.
const DWELL_MS: u32 = 50;
/// Highest speed of a slow motor: two counts in 50 ms. The estimate may be wrong by one count, and a regulator that holds
/// a position may move the motor by another count.
const SLOW: CountsPerSecond = CountsPerSecond::new(40);

/// True if a position is within the tolerance of a target, by REV's definition: |target - position| <= tolerance, the
/// short way round the ring of 2^32 counts.
pub const fn within_tolerance(target: i32, position: i32, tolerance: u16) -> bool {
    target.wrapping_sub(position).unsigned_abs() <= tolerance as u32
}

/// Detects whether a motor, or a group of motors, has settled.
#[derive(Clone, Copy, Debug, Default)]
pub struct SettleDetector {
    /// Time in ms for which the motor has been within tolerance and slow at every tick; `None` if the motor was not
    /// within tolerance and slow at the last tick.
    settling_ms: Option<u32>,
}

impl SettleDetector {
    /// Restarts the dwell, because the target has changed.
    pub const fn reset(&mut self) {
        self.settling_ms = None;
    }

    /// Takes a tick: whether the motor is within tolerance, and its speed. Returns true if the motor has settled. The
    /// dwell is 50 ms, or one period if the period is longer.
    pub fn step(&mut self, within_tolerance: bool, velocity: CountsPerSecond, period: Period) -> bool {
        let slow = velocity.to_bits().unsigned_abs() <= SLOW.to_bits().unsigned_abs();
        self.settling_ms = match self.settling_ms {
            _ if !(within_tolerance && slow) => None,
            None => Some(0),
            Some(ms) => Some(ms.saturating_add(period.as_millis())),
        };
        self.settling_ms.is_some_and(|ms| ms >= DWELL_MS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Pairs of a period in milliseconds and the number of ticks until the dwell is over.
    const TICKS: [(u32, usize); 4] = [(1, 50), (30, 2), (50, 1), (100, 1)];

    /// A detector with the control period.
    struct Detector(SettleDetector, Period);

    impl Detector {
        fn new(ms: u32) -> Self {
            Self(SettleDetector::default(), Period::from_millis(ms).unwrap_or_default())
        }

        fn step(&mut self, within_tolerance: bool, speed: i32) -> bool {
            self.0.step(within_tolerance, CountsPerSecond::new(speed), self.1)
        }
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
    fn a_slow_motor_within_tolerance_has_settled_after_the_dwell() {
        for (ms, ticks) in TICKS {
            for speed in [0, 40, -40] {
                let mut detector = Detector::new(ms);
                assert!((0..ticks).all(|_| !detector.step(true, speed)), "{ms} ms, {speed}");
                assert!((0..200).all(|_| detector.step(true, speed)), "{ms} ms, {speed}");
            }
        }
    }

    #[test]
    fn a_motor_that_passes_its_target_at_speed_has_not_settled() {
        for (ms, _) in TICKS {
            for speed in [41, -41, 3_000] {
                let mut detector = Detector::new(ms);
                assert!((0..200).all(|_| !detector.step(true, speed)), "{ms} ms, {speed}");
            }
        }
    }

    #[test]
    fn a_motor_that_is_displaced_or_gets_another_target_settles_again_after_the_dwell() {
        for (ms, ticks) in TICKS {
            for disturb in [
                |detector: &mut Detector| assert!(!detector.step(false, 0)),
                |detector: &mut Detector| assert!(!detector.step(true, -500)),
                |detector: &mut Detector| detector.0.reset(),
            ] {
                let mut detector = Detector::new(ms);
                assert!((0..ticks).all(|_| !detector.step(true, 0)), "{ms} ms");
                assert!(detector.step(true, 0), "{ms} ms");
                disturb(&mut detector);
                assert!((0..ticks).all(|_| !detector.step(true, 0)), "{ms} ms");
                assert!(detector.step(true, 0), "{ms} ms");
            }
        }
    }
}
