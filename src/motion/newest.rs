//! Where a motor is and how fast it turns, as of the newest sample of its encoder: for whoever looks between two ticks.

use super::{Reading, VelocityEstimator};
use crate::units::{CountsPerSecond, Micros, Period, constant};

/// Readings for the speed are kept this far apart.
const SPACING: Period = constant!(Period::from_millis(5));

/// The counts of so long a time are a speed: at 1 kHz an edge's time is good for 2 % of it.
const WINDOW_MS: u32 = 50;

/// As of the newest sample of an encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Motion {
    /// Counts.
    pub position: i32,
    /// Estimated: of a motor that is known, by its observer; else the mean of the last 50 ms.
    pub velocity: CountsPerSecond,
}

/// Follows the samples of a motor of which nothing is known.
#[derive(Clone, Debug)]
pub(crate) struct Newest {
    estimator: VelocityEstimator,
    last: Option<Reading>,
    kept: Micros,
}

impl Newest {
    pub(crate) const fn new() -> Self {
        let estimator = VelocityEstimator::over(WINDOW_MS, SPACING);
        Self { estimator, last: None, kept: Micros::new(0) }
    }

    pub(crate) fn sample(&mut self, reading: Reading) {
        if self.last.is_none() || reading.at.since(self.kept) >= SPACING.as_micros() {
            self.estimator.step(reading);
            self.kept = reading.at;
        }
        self.last = Some(reading);
    }

    pub(crate) fn position(&self) -> i32 {
        self.last.map_or(0, |last| last.position)
    }

    pub(crate) fn velocity(&self) -> CountsPerSecond {
        self.last.map_or(CountsPerSecond::ZERO, |last| self.estimator.ahead(last))
    }
}
