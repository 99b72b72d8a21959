//! Choice of the coefficients of the speed loop. They are the same for all variants, or each variant has its best
//! coefficients of one grid.

use super::row::Row;
use super::tasks::Task;
use super::variant::Variant;
use crate::StudyError;
use crate::settling::Goal;
use motor_hub::model::catalogue::Motor;
use motor_hub::motion::Pidf;
use motor_hub::units::{Coefficient, Control};
use serde::Serialize;

/// P and I of the speed loop as multiples of `f = 32767 keFw / 12000`, in control steps per count/s. If P is `f`, an
/// error as large as the speed whose back EMF is 12 V gives full control. D and F are 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Gains {
    /// P divided by `f`.
    pub(super) p: f64,
    /// I divided by `f`, in 1/s.
    pub(super) i: f64,
}

impl Gains {
    /// Returns the coefficients for a motor. The hub adds the integral once per control period of 50 ms, so I is
    /// divided by 20.
    pub(super) fn coefficients(self, motor: &Motor) -> Pidf {
        let f = f64::from(Control::MAX.get()) * motor.ke_fw() / 12_000.0;
        // Casts from float saturate.
        let fixed = |factor: f64| Coefficient::from_bits((factor * f * f64::from(1 << 16)).round() as i32);
        Pidf { p: fixed(self.p), i: fixed(self.i / 20.0), d: Coefficient::ZERO, f: Coefficient::ZERO }
    }
}

/// The coefficients of all variants in the first round.
const SAME: Gains = Gains { p: 1.5, i: 7.5 };

/// P of the candidates for each variant's best coefficients, as multiples of `f`.
const P: [f64; 6] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0];
/// I of the candidates, as multiples of `f`, in 1/s.
const I: [f64; 4] = [4.0, 7.5, 11.0, 15.0];

/// Weight of the overshoot in the criterion, in seconds. The weight of the integral of |error| is 1.
const OF_OVERSHOOT_S: f64 = 0.2;
/// Weight of the limit cycle in the criterion, in seconds.
const OF_LIMIT_CYCLE_S: f64 = 1.0;

/// The candidates for the best coefficients of a variant; none for the model, which has no coefficients.
fn candidates(variant: Variant) -> impl Iterator<Item = Gains> {
    let all = P.into_iter().flat_map(|p| I.map(|i| Gains { p, i }));
    all.filter(move |_| variant.has_coefficients())
}

/// Number of runs that find the best coefficients of all variants.
pub(super) fn runs() -> usize {
    Variant::ALL.into_iter().flat_map(candidates).count()
}

/// A way of choosing coefficients, and the chosen coefficients.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Tuning {
    /// The choice in words.
    pub(super) how: String,
    /// The choice as a part of file names.
    pub(super) key: &'static str,
    /// The choice in a few words.
    #[serde(skip)]
    pub(super) key_in_words: &'static str,
    /// Coefficients by variant; null for the model, which has none.
    pub(super) gains: Vec<Option<Gains>>,
}

impl Tuning {
    /// The same coefficients for all variants.
    pub(super) fn same() -> Self {
        Self {
            how: format!("the same coefficients for all: P = {} f, I = {} f", SAME.p, SAME.i),
            key: "same",
            key_in_words: "the same coefficients for all",
            gains: Variant::ALL.map(|variant| variant.has_coefficients().then_some(SAME)).to_vec(),
        }
    }

    /// Chooses for each variant the coefficients of [`P`] and [`I`] with the least criterion at a task.
    pub(super) fn best(task: &Task, step: &mut dyn FnMut()) -> Result<Self, StudyError> {
        let mut gains = vec![None; Variant::ALL.len()];
        for (variant, gains) in Variant::ALL.into_iter().zip(&mut gains) {
            let mut least = f64::INFINITY;
            for candidate in candidates(variant) {
                let cost = cost(task, &Row::of(task, variant, Some(candidate))?);
                if cost < least {
                    (least, *gains) = (cost, Some(candidate));
                }
                step();
            }
        }
        let list = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
        let how = format!(
            "for each variant its best of P = {} f\nwith I = {} f on the first task: least integral of |error| \
             + {OF_OVERSHOOT_S} s x overshoot + {OF_LIMIT_CYCLE_S} s x limit cycle",
            list(&P),
            list(&I),
        );
        Ok(Self { how, key: "best", key_in_words: "each variant's own best coefficients", gains })
    }
}

/// The criterion of a run, in counts; the least is the best.
fn cost(task: &Task, row: &Row) -> f64 {
    let step = task.scenario.motors.first().map_or(0.0, |motor| {
        let target = |at_s| Goal::of(motor.setpoint_at(at_s)).map_or(0.0, Goal::target);
        (target(task.event_s) - target(0.0)).abs()
    });
    let overshoot = row.response.overshoot_percent.unwrap_or(0.0) / 100.0 * step;
    row.response.absolute_error_s + OF_OVERSHOOT_S * overshoot + OF_LIMIT_CYCLE_S * row.response.swing
}
