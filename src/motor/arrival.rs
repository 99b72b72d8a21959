//! When a motor has come to its target: near it and standing, and both for a while.

use crate::units::{CountsPerSecond, Period};

/// For so long, and a control period at least: a motor that turns back within it has only passed.
const DWELL_MS: u32 = 50;
/// What stands moves no more than two counts in that: one may be the estimate's, the other a regulator's.
const STANDING: CountsPerSecond = CountsPerSecond::new(40);

/// Whether a motor has arrived.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arrival {
    /// Ticks that make the dwell.
    dwell: u32,
    /// Ticks in a row at which it stood near its target, one more than the dwell at most.
    there: u32,
}

impl Arrival {
    /// Asked every `period`.
    pub(super) const fn new(period: Period) -> Self {
        Self { dwell: DWELL_MS.div_ceil(period.as_millis()), there: 0 }
    }

    /// It has another target.
    pub(super) const fn reset(&mut self) {
        self.there = 0;
    }

    /// One tick, at which the motor is or is not within the tolerance of its target, and has this speed.
    pub(super) fn step(&mut self, near: bool, velocity: CountsPerSecond) -> bool {
        let stands = velocity.to_bits().unsigned_abs() <= STANDING.to_bits().unsigned_abs();
        self.there = if near && stands { self.there.saturating_add(1).min(self.dwell + 1) } else { 0 };
        self.there > self.dwell
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A period in milliseconds, and the ticks from the first one at the target to the first that says so.
    const TICKS: [(u32, usize); 4] = [(1, 50), (30, 2), (50, 1), (100, 1)];

    fn arrival(ms: u32) -> Arrival {
        Arrival::new(Period::from_millis(ms).unwrap_or_default())
    }

    fn cps(speed: i32) -> CountsPerSecond {
        CountsPerSecond::new(speed)
    }

    #[test]
    fn a_motor_that_stands_at_its_target_has_arrived_after_the_dwell() {
        for (ms, ticks) in TICKS {
            for speed in [0, 40, -40] {
                let mut arrival = arrival(ms);
                assert!((0..ticks).all(|_| !arrival.step(true, cps(speed))), "{ms} ms, {speed}");
                assert!((0..200).all(|_| arrival.step(true, cps(speed))), "{ms} ms, {speed}");
            }
        }
    }

    #[test]
    fn a_motor_that_passes_its_target_at_speed_has_not_arrived() {
        for (ms, _) in TICKS {
            for speed in [41, -41, 3_000] {
                let mut arrival = arrival(ms);
                assert!((0..200).all(|_| !arrival.step(true, cps(speed))), "{ms} ms, {speed}");
            }
        }
    }

    #[test]
    fn a_motor_that_is_pushed_off_or_sent_elsewhere_arrives_anew() {
        for (ms, ticks) in TICKS {
            for disturb in [
                |arrival: &mut Arrival| assert!(!arrival.step(false, cps(0))),
                |arrival: &mut Arrival| assert!(!arrival.step(true, cps(-500))),
                Arrival::reset,
            ] {
                let mut arrival = arrival(ms);
                assert!((0..ticks).all(|_| !arrival.step(true, cps(0))), "{ms} ms");
                assert!(arrival.step(true, cps(0)), "{ms} ms");
                disturb(&mut arrival);
                assert!((0..ticks).all(|_| !arrival.step(true, cps(0))), "{ms} ms");
                assert!(arrival.step(true, cps(0)), "{ms} ms");
            }
        }
    }
}
