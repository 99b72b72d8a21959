//! Fits the motor's equation to the changes from segment to segment, and decides whether the result can be used. Each
//! change is a *row* of the fit: one equation for the unknowns. The *innovation* of a row is its error with the
//! unknowns of the earlier rows.

use super::super::Dynamics;
use super::fit::{Fit, Solution, UNKNOWNS};
use super::outcome::{Identified, Refusal};
use super::segments::Change;
use crate::units::{AccelerationPerVolt, DecayRate, EmfConstant, Millivolts};

/// Least number of rows of a result.
const LEAST_ROWS: u16 = 12;
/// Largest noise of a row because of whole counts, in counts (root mean square).
const COUNTING_NOISE_COUNTS: f32 = 0.7;
/// Largest error of the bridge's voltage, as a share of the battery voltage.
const VOLTAGE_NOISE_SHARE: f32 = 0.015;
/// Largest difference of the highest and the lowest running sum of innovations, in multiples of the noise. Errors of
/// whole counts cancel in this sum. The errors from a load that changes, by time or by position, do not cancel.
const LARGEST_DRIFT: f32 = 9.0;
/// Number of first rows that are left out of the running sum. After so few rows every innovation is large.
const SETTLING_ROWS: u16 = 8;
/// Constant load above which an identification is refused.
const LARGEST_LOAD: Threshold = Threshold { battery_share: 0.02, standard_errors: 3.0 };
/// Force of a spring at the end of the travel above which an identification is refused.
const LARGEST_SPRING: Threshold = Threshold { battery_share: 0.04, standard_errors: 5.0 };
/// Largest standard error of a result, as a share of the result.
const LARGEST_ERROR: f32 = 0.1;
/// Friction in multiples of its standard error below which the friction is noise and counts as 0.
const LEAST_FRICTION_ERRORS: f32 = 2.0;
/// Least and largest plausible ratio of the back EMF found to the configured back EMF.
const PLAUSIBLE_EMF_RATIO: (f32, f32) = (0.7, 8.0);

/// Index of the unknown b, the acceleration per volt.
const GAIN: usize = 0;
/// Index of the unknown q / kappa, with the configured back EMF kappa.
const DECAY: usize = 1;
/// Index of the unknown friction.
const FRICTION: usize = 2;
/// Index of the unknown constant load.
const LOAD: usize = 3;
/// Index of the unknown spring: its acceleration at the end of the travel.
const SPRING: usize = 4;

/// Threshold of an acceleration among the unknowns: the larger one of two values.
#[derive(Clone, Copy)]
struct Threshold {
    /// First value: the voltage that causes the acceleration, as a share of the battery voltage.
    battery_share: f32,
    /// Second value: a number of standard errors of the unknown.
    standard_errors: f32,
}

/// The fit of a motion, with the statistics that decide whether the result can be used.
#[derive(Clone, Copy, Debug)]
pub(super) struct Regression {
    /// Configured back EMF, in V per count/s.
    emf: f32,
    /// Battery voltage before the motion, in V.
    pub(super) battery: f32,
    /// Announced travel, in counts.
    pub(super) announced_travel: f32,
    fit: Fit,
    /// Running sum of the innovations, in counts.
    sum: f32,
    /// Highest running sum so far, in counts.
    highest: f32,
    /// Lowest running sum so far, in counts.
    lowest: f32,
    /// Sum of the squared durations of the shorter segment of each row, in s².
    squares: f32,
}

impl Regression {
    /// Creates a fit without rows.
    pub(super) fn new(emf: f32, battery: f32, announced_travel: f32) -> Self {
        Self {
            emf,
            battery,
            announced_travel,
            fit: Fit::default(),
            sum: 0.0,
            highest: 0.0,
            lowest: 0.0,
            squares: 0.0,
        }
    }

    /// Adds a row. The row is multiplied by the duration of the shorter segment, so its unit is the count and all
    /// rows have equal noise. The first two unknowns are accelerations per volt, the other unknowns are
    /// accelerations.
    pub(super) fn add(&mut self, change: &Change) {
        let Change { speed, volt_seconds, distance, position, seconds, shorter_s, side } = *change;
        let spring = -position / self.announced_travel * seconds;
        let row = [volt_seconds, -self.emf * distance, -side * seconds, seconds, spring, speed];
        let innovation = self.fit.add(row.map(|value| value * shorter_s));
        if self.fit.rows() > SETTLING_ROWS {
            self.sum += innovation;
            self.highest = self.highest.max(self.sum);
            self.lowest = self.lowest.min(self.sum);
        }
        self.squares += shorter_s * shorter_s;
    }

    /// The result of the motion, or the reason to refuse a result.
    pub(super) fn result(&self) -> Result<Identified, Refusal> {
        if self.fit.rows() < LEAST_ROWS {
            return Err(Refusal::Inaccurate);
        }
        // A motion in one direction cannot separate load from friction. The load is then taken for 0.
        let without_load = self.fit.solve(FRICTION + 1).ok_or(Refusal::Inaccurate)?;
        let with_load = self.fit.solve(LOAD + 1);
        let best = with_load.unwrap_or(without_load);
        let b = best.values[GAIN];
        if b.is_nan() || b <= 0.0 {
            return Err(Refusal::Implausible);
        }
        let exceeds = |solution: Option<Solution>, of: usize, threshold: Threshold| {
            solution.is_some_and(|solution| {
                let Some(&value) = solution.values.get(of) else { return false };
                let Threshold { battery_share, standard_errors } = threshold;
                let error = solution.error(unit(of));
                value.abs() > (battery_share * self.battery * b).max(standard_errors * error)
            })
        };
        if exceeds(self.fit.solve(UNKNOWNS), SPRING, LARGEST_SPRING) {
            return Err(Refusal::Spring);
        }
        if exceeds(with_load, LOAD, LARGEST_LOAD) {
            return Err(Refusal::Load);
        }
        let noise = COUNTING_NOISE_COUNTS
            + VOLTAGE_NOISE_SHARE * self.battery * b * self.squares / f32::from(self.fit.rows());
        if self.highest - self.lowest > LARGEST_DRIFT * noise {
            return Err(Refusal::PoorFit);
        }
        self.identified(&best)
    }

    /// Converts a solution to the motor's constants, if its errors are small and its back EMF is plausible.
    fn identified(&self, best: &Solution) -> Result<Identified, Refusal> {
        let [b, decay, friction, ..] = best.values;
        let ratio = decay / b;
        let gain_error = best.error(unit(GAIN)) / b;
        let ratio_error = best.error([-ratio / b, 1.0 / b, 0.0, 0.0, 0.0]);
        if gain_error.is_nan() || gain_error >= LARGEST_ERROR {
            return Err(Refusal::Inaccurate);
        }
        let (low, high) = PLAUSIBLE_EMF_RATIO;
        if ratio + 2.0 * ratio_error < low || ratio - 2.0 * ratio_error > high {
            return Err(Refusal::Implausible);
        }
        let emf_is_configured = ratio_error.is_nan() || ratio_error >= LARGEST_ERROR * ratio;
        let emf = if emf_is_configured { self.emf } else { ratio * self.emf };
        let volts = friction / b;
        let volts_error = best.error([-volts / b, 0.0, 1.0 / b, 0.0, 0.0]);
        let friction = if volts > LEAST_FRICTION_ERRORS * volts_error { volts } else { 0.0 };
        let implausible = |_| Refusal::Implausible;
        Ok(Identified {
            dynamics: Dynamics {
                gain: AccelerationPerVolt::from_f64(b.into()).map_err(implausible)?,
                decay: DecayRate::from_f64((b * emf).into()).map_err(implausible)?,
                friction: Millivolts::from_volts(friction.into()).map_err(implausible)?,
            },
            emf: EmfConstant::from_bits((emf * 1e3 * (1 << 20) as f32) as i32).map_err(implausible)?,
            emf_is_configured,
            gain_error: per_mille(gain_error),
            decay_error: per_mille(best.error(unit(DECAY)) / decay.abs()),
            emf_error: per_mille(ratio_error / ratio.abs()),
            friction_error: Millivolts::new(per_mille(volts_error)),
            residual: per_mille(best.residual / self.fit.right_rms()),
        })
    }
}

/// Weights that select one unknown.
fn unit(of: usize) -> [f32; UNKNOWNS] {
    core::array::from_fn(|n| if n == of { 1.0 } else { 0.0 })
}

/// Converts a share to 1/1000, rounded; saturates at the type's range. NaN becomes 0.
const fn per_mille(share: f32) -> u16 {
    (1000.0 * share + 0.5) as u16
}
