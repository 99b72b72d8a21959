//! Coefficients of the speed loop: the same for all, or for each variant the best of one grid.

use super::{Row, Task, Variant, run};
use crate::StudyError;
use motor_hub::model::catalogue::Motor;
use motor_hub::motion::Pidf;
use motor_hub::regulator::Kind;
use motor_hub::units::{Coefficient, Control};
use serde::Serialize;

/// P and I as multiples of `f = 32767 keFw / 12000`, control steps per count/s: full control at the
/// speed whose back EMF is 12 V. D and F are 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Gains {
    /// P / f.
    pub p: f64,
    /// I / f, per second.
    pub i: f64,
}

/// What all variants get in the first round.
pub const SAME: Gains = Gains { p: 1.5, i: 7.5 };

const P: [f64; 6] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0];
const I: [f64; 4] = [4.0, 7.5, 11.0, 15.0];

/// What each variant's best is taken from.
pub const GRID: [Gains; P.len() * I.len()] = {
    let mut grid = [SAME; P.len() * I.len()];
    let mut n = 0;
    while n < grid.len() {
        grid[n] = Gains { p: P[n / I.len()], i: I[n % I.len()] };
        n += 1;
    }
    grid
};

/// Weights of the criterion beside the integral of the error's size, in seconds.
const OF_OVERSHOOT_S: f64 = 0.2;
const OF_LIMIT_CYCLE_S: f64 = 1.0;

/// Runs that it takes to find the best for each variant.
pub(super) fn runs() -> usize {
    GRID.len() * Variant::ALL.into_iter().filter(|variant| has_coefficients(*variant)).count()
}

fn has_coefficients(variant: Variant) -> bool {
    variant.regulator == Kind::Pid
}

/// A way of choosing coefficients, and what it chose.
#[derive(Clone, Debug, Serialize)]
pub struct Tuning {
    /// In words.
    pub how: String,
    /// A name for files.
    pub key: &'static str,
    /// By variant; null for a model, which has none.
    pub gains: Vec<Option<Gains>>,
}

impl Gains {
    /// The coefficients for a motor.
    pub fn coefficients(self, motor: &Motor) -> Pidf {
        let f = f64::from(Control::MAX.get()) * motor.ke_fw() / 12_000.0;
        // Casts from float saturate.
        let fixed = |factor: f64| Coefficient::from_bits((factor * f * f64::from(1 << 16)).round() as i32);
        Pidf { p: fixed(self.p), i: fixed(self.i), d: Coefficient::ZERO, f: Coefficient::ZERO }
    }
}

impl Tuning {
    /// The same for all.
    pub fn same() -> Self {
        Self {
            how: format!("the same coefficients for all: P = {} f, I = {} f", SAME.p, SAME.i),
            key: "same",
            gains: Variant::ALL.map(|variant| has_coefficients(variant).then_some(SAME)).to_vec(),
        }
    }

    /// In a few words.
    pub fn key_in_words(&self) -> &'static str {
        if self.key == "same" {
            "the same coefficients for all"
        } else {
            "each variant's own best coefficients"
        }
    }

    /// For each variant the best of [`GRID`] at a task.
    ///
    /// # Errors
    /// If a run fails.
    pub fn best(task: &Task, step: &mut dyn FnMut()) -> Result<Self, StudyError> {
        let mut gains = Vec::with_capacity(Variant::ALL.len());
        for variant in Variant::ALL {
            if !has_coefficients(variant) {
                gains.push(None);
                continue;
            }
            let mut best = (f64::INFINITY, SAME);
            for candidate in GRID {
                let cost = cost(task, &run(task, variant, Some(candidate))?);
                if cost < best.0 {
                    best = (cost, candidate);
                }
                step();
            }
            gains.push(Some(best.1));
        }
        let list = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
        let how = format!(
            "for each variant its best of P = {} f\nwith I = {} f on the first task: least integral of |error| \
             + {OF_OVERSHOOT_S} s x overshoot + {OF_LIMIT_CYCLE_S} s x limit cycle",
            list(&P),
            list(&I),
        );
        Ok(Self { how, key: "best", gains })
    }
}

/// What a run costs, in counts.
fn cost(task: &Task, row: &Row) -> f64 {
    let step = task.scenario.motors.first().map_or(0.0, |motor| {
        let target = |at_s| match motor.setpoint_at(at_s) {
            motor_hub::motor::Setpoint::Velocity(cps) => cps.to_f64(),
            _ => 0.0,
        };
        (target(task.event_s) - target(0.0)).abs()
    });
    let overshoot = row.overshoot_percent.unwrap_or(0.0) / 100.0 * step;
    row.absolute_error + OF_OVERSHOOT_S * overshoot + OF_LIMIT_CYCLE_S * row.limit_cycle
}
