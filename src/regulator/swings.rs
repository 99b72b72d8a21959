//! Detects a speed that *swings* about the speed that the motor should have, for longer than the regulator needs to
//! settle. (A speed that *hunts* has another cause, a back EMF constant that is too high: see `hunting.rs`.)
//!
//! The cause of swings is an acceleration per volt in use, configured or estimated, that is lower than the motor's true
//! value. The law then corrects too much: with less than about half of the true value each error becomes an error of
//! the other sign that is as large, and the swing does not end:
//!
//! ```text
//!   speed        .            .
//!   + limit ....: :..........: :.........
//!   wanted     :   :        :   :
//!   - limit ..:.....:......:.....:.......
//!            '       '....'       '...
//!               |------|----|-----|         half swings: from beyond one limit to beyond the other
//! ```
//!
//! The fourth short half swing in a row, and each further one, shows that the swing lasts. Long half swings have
//! another cause: a slow load, friction, or a gain that is too high. The fourth long half swing in a row, and each
//! further one, shows that the gain is not too low.

use super::Demand;
use crate::units::single::at_least;

/// The detector of one motor.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Swings {
    /// Sign of the last error beyond the limit; 0 before the first one.
    side: i8,
    /// Time since the sign has changed, in ms.
    age_ms: u16,
    /// Number of short half swings in a row. A negative number counts long half swings in a row. `i8::MAX` if the
    /// detector is [off](Self::OFF).
    half_swings: i8,
}

/// What the half swings show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Swing {
    /// Short half swings follow each other: the acceleration per volt in use is too low.
    Fast,
    /// Long half swings follow each other: the acceleration per volt in use is not too low.
    Slow,
}

/// Limits of the detector. Of an error as a share and an error in counts/s the larger one is the limit.
/// `docs/decisions/0030-a-speed-that-swings.md` has the figures behind the values.
impl Swings {
    /// Least error of a demanded speed that counts as a swing, as a share of the speed that the motor should have.
    const LEAST_ERROR_SHARE: f32 = 0.008;
    /// Least error of a demanded speed that counts as a swing, in counts/s.
    const LEAST_ERROR_CPS: f32 = 0.8;
    /// Least error of the speed on the way to a position, as a share of the planned speed. It is larger than for a
    /// demanded speed: a gain that is raised by mistake also raises the planned deceleration, and the motor overshoots
    /// its target.
    const LEAST_POSITION_ERROR_SHARE: f32 = 0.1;
    /// Least error of the speed on the way to a position, or while the motor holds it, in counts/s. A motor that holds
    /// its position may move by a count, and its speed is then estimated too high.
    const LEAST_POSITION_ERROR_CPS: f32 = 20.0;
    /// Longest duration of a short half swing, in ms. At a long control period a half swing of up to four ticks is
    /// short too.
    const SHORT_HALF_SWING_MS: u16 = 150;
    /// Largest number of short, or of long, half swings in a row from which nothing is concluded.
    const MOST_HALF_SWINGS: i8 = 3;
}

impl Swings {
    /// A detector that is off: it reports nothing until it is replaced.
    pub(super) const OFF: Self = Self { side: 0, age_ms: 0, half_swings: i8::MAX };

    /// Updates the detector at a control tick. The caller replaces the detector when the demand changes. `speed` is the
    /// estimated speed, and `wanted` the speed that the motor should have, both in counts/s. Returns what the half
    /// swings show, if a half swing ends at this tick.
    pub(super) fn step(&mut self, demand: Demand, speed: f32, wanted: f32, period_ms: u16) -> Option<Swing> {
        self.age_ms = self.age_ms.saturating_add(period_ms);
        let error = speed - wanted;
        let side = if error > 0.0 { 1 } else { -1 };
        if side == self.side || self.half_swings == i8::MAX {
            return None;
        }
        let (share, least) = if let Demand::Velocity(_) = demand {
            (Self::LEAST_ERROR_SHARE, Self::LEAST_ERROR_CPS)
        } else {
            (Self::LEAST_POSITION_ERROR_SHARE, Self::LEAST_POSITION_ERROR_CPS)
        };
        let limit = at_least(share * wanted.abs(), least);
        if error.abs() <= limit {
            return None;
        }
        let short = self.age_ms <= Self::SHORT_HALF_SWING_MS.max(4 * period_ms);
        self.half_swings = match self.side {
            0 => 0,
            _ if short => (self.half_swings.max(0) + 1).min(Self::MOST_HALF_SWINGS + 1),
            _ => (self.half_swings.min(0) - 1).max(-Self::MOST_HALF_SWINGS - 1),
        };
        (self.side, self.age_ms) = (side, 0);
        match self.half_swings {
            count if count > Self::MOST_HALF_SWINGS => Some(Swing::Fast),
            count if count < -Self::MOST_HALF_SWINGS => Some(Swing::Slow),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::units::CountsPerSecond;

    const SET_POINT: f32 = 1_000.0;

    /// Ticks of 50 ms until the detector reports a swing, at most 200; `None` if there is none. The error of the speed
    /// in counts/s is a function of the tick.
    fn found(error: impl Fn(u32) -> f32, demand: Demand) -> Option<u32> {
        let mut swings = Swings::default();
        let wanted = if demand == SPEED { SET_POINT } else { 0.0 };
        (0..200).find(|&tick| swings.step(demand, wanted + error(tick), wanted, 50) == Some(Swing::Fast))
    }

    const SPEED: Demand = Demand::Velocity(CountsPerSecond::new(1_000));
    const POSITION: Demand = Demand::Position { target: 0, speed_limit: CountsPerSecond::MAX };

    /// A speed that is `size` counts/s too high and too low for `ticks` ticks each.
    fn square(size: f32, ticks: u32) -> impl Fn(u32) -> f32 {
        move |tick| if (tick / ticks).is_multiple_of(2) { size } else { -size }
    }

    #[test]
    fn a_speed_that_swings_for_some_half_swings_is_found() {
        for demand in [SPEED, POSITION] {
            assert_eq!(found(square(21.0, 1), demand), Some(4));
            assert_eq!(found(square(21.0, 4), demand), Some(16));
        }
    }

    #[test]
    fn a_slow_swing_is_told_from_a_fast_one() {
        let mut swings = Swings::default();
        let found = (0..200).find_map(|tick| swings.step(POSITION, square(21.0, 5)(tick), 0.0, 50));
        assert_eq!(found, Some(Swing::Slow));
    }

    #[test]
    fn a_small_or_slow_or_ending_swing_and_a_constant_error_are_not_found() {
        assert_eq!(found(square(7.0, 1), SPEED), None);
        assert_eq!(found(square(19.0, 1), POSITION), None);
        for demand in [SPEED, POSITION] {
            assert_eq!(found(square(21.0, 5), demand), None);
            assert_eq!(found(|_| 21.0, demand), None);
            // Each half swing is half as large as the last one.
            assert_eq!(found(|tick| square(50.0, 1)(tick) / (1 << tick.min(20)) as f32, demand), None);
        }
    }
}
