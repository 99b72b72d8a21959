//! From rows to an answer, or to the reason why there is none.

use super::super::Dynamics;
use super::super::cells::Change;
use super::fit::{Fit, Solution, UNKNOWNS};
use super::outcome::{Identified, Refusal};
use crate::units::{AccelerationPerVolt, DecayRate, EmfConstant, Millivolts};

/// Rows that an answer needs.
const LEAST_ROWS: u16 = 12;
/// Root mean square of what whole counts make of a row, in counts, at most.
const COUNTING_NOISE: f32 = 0.7;
/// What a bridge's voltage may be off by, as a share of the battery's.
const VOLTAGE_NOISE: f32 = 0.015;
/// So many times that noise the running sum of rows may be off, in which counting cancels out and a load
/// that comes, goes or changes with the position does not.
const LARGEST_DRIFT: f32 = 9.0;
/// The first rows surprise whatever they say.
const INTRODUCTION: u16 = 8;
/// Load and spring count from this share of the battery's voltage on, if they are so many times their
/// standard error.
const LOADED: (f32, f32) = (0.02, 3.0);
const SPRUNG: (f32, f32) = (0.04, 5.0);
/// Standard error of what is found, at most.
const LARGEST_ERROR: f32 = 0.1;
/// Of the back EMF found to that told.
const PLAUSIBLE: (f32, f32) = (0.7, 8.0);

/// The rows' weights of b, of q as a back EMF, friction, load and spring.
const GAIN: usize = 0;
const DECAY: usize = 1;
const FRICTION: usize = 2;
const LOAD: usize = 3;
const SPRING: usize = 4;

/// What is known of a motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Evidence {
    /// Told, in volts per count/s.
    emf: f32,
    /// Volts.
    battery: f32,
    /// Counts that the motion may take.
    span: f32,
    fit: Fit,
    /// Running sum of what the rows before one did not expect of it, in counts, and how far it went.
    sum: f32,
    highest: f32,
    lowest: f32,
    /// Sum of the squares of the cells' lengths, s².
    squares: f32,
}

impl Evidence {
    pub(super) fn new(emf: f32, battery: f32, span: f32) -> Self {
        Self { emf, battery, span, fit: Fit::default(), sum: 0.0, highest: 0.0, lowest: 0.0, squares: 0.0 }
    }

    /// One more row, in counts of the shorter of its cells, whose noise is then the same for all; each
    /// unknown is an acceleration per volt.
    pub(super) fn add(&mut self, change: &Change) {
        let Change { speed, push, way, place, time, shorter: seconds, side } = *change;
        let row = [push, -self.emf * way, -side * time, time, -place / self.span * time, speed];
        let surprise = self.fit.add(row.map(|value| value * seconds));
        if self.fit.rows() > INTRODUCTION {
            self.sum += surprise;
            self.highest = self.highest.max(self.sum);
            self.lowest = self.lowest.min(self.sum);
        }
        self.squares += seconds * seconds;
    }

    pub(super) fn judge(&self) -> Result<Identified, Refusal> {
        if self.fit.rows() < LEAST_ROWS {
            return Err(Refusal::Unsure);
        }
        // A motion in one direction does not tell load from friction, but the rest all the same.
        let short = self.fit.solve(FRICTION + 1).ok_or(Refusal::Unsure)?;
        let with_load = self.fit.solve(LOAD + 1);
        let best = with_load.unwrap_or(short);
        let b = best.values[GAIN];
        if b.is_nan() || b <= 0.0 {
            return Err(Refusal::Implausible);
        }
        let pulls = |solution: Option<Solution>, of: usize, (least, certain): (f32, f32)| {
            solution.is_some_and(|solution| {
                let Some(&value) = solution.values.get(of) else { return false };
                let error = solution.error(unit(of));
                value.abs() > (least * self.battery * b).max(certain * error)
            })
        };
        if pulls(self.fit.solve(UNKNOWNS), SPRING, SPRUNG) {
            return Err(Refusal::Spring);
        }
        if pulls(with_load, LOAD, LOADED) {
            return Err(Refusal::Load);
        }
        let noise =
            COUNTING_NOISE + VOLTAGE_NOISE * self.battery * b * self.squares / f32::from(self.fit.rows());
        if self.highest - self.lowest > LARGEST_DRIFT * noise {
            return Err(Refusal::Uneven);
        }
        self.answer(&best)
    }

    fn answer(&self, best: &Solution) -> Result<Identified, Refusal> {
        let [b, decay, friction, ..] = best.values;
        let ratio = decay / b;
        let gain_error = best.error(unit(GAIN)) / b;
        let ratio_error = best.error([-ratio / b, 1.0 / b, 0.0, 0.0, 0.0]);
        if gain_error.is_nan() || gain_error >= LARGEST_ERROR {
            return Err(Refusal::Unsure);
        }
        let (low, high) = PLAUSIBLE;
        if ratio + 2.0 * ratio_error < low || ratio - 2.0 * ratio_error > high {
            return Err(Refusal::Implausible);
        }
        let emf_is_told = ratio_error.is_nan() || ratio_error >= LARGEST_ERROR * ratio;
        let emf = if emf_is_told { self.emf } else { ratio * self.emf };
        let volts = friction / b;
        let implausible = |_| Refusal::Implausible;
        Ok(Identified {
            dynamics: Dynamics {
                gain: AccelerationPerVolt::from_f64(b.into()).map_err(implausible)?,
                decay: DecayRate::from_f64((b * emf).into()).map_err(implausible)?,
                friction: Millivolts::from_volts(volts.max(0.0).into()).map_err(implausible)?,
            },
            emf: EmfConstant::from_bits((emf * 1e3 * (1 << 20) as f32) as i32).map_err(implausible)?,
            emf_is_told,
            gain_error: per_mille(gain_error),
            decay_error: per_mille(best.error(unit(DECAY)) / decay.abs()),
            emf_error: per_mille(ratio_error / ratio.abs()),
            friction_error: Millivolts::new(per_mille(best.error([-volts / b, 0.0, 1.0 / b, 0.0, 0.0]))),
            residual: per_mille(best.residual / self.fit.seen()),
        })
    }
}

/// One unknown alone.
fn unit(of: usize) -> [f32; UNKNOWNS] {
    core::array::from_fn(|n| if n == of { 1.0 } else { 0.0 })
}

/// Saturates; what is no number becomes 0.
const fn per_mille(share: f32) -> u16 {
    (1000.0 * share + 0.5) as u16
}
