//! Coefficients of the speed loop, in relation to what the motor can do.

use motor_hub::model::catalogue::Motor;
use motor_hub::motion::Pidf;
use motor_hub::units::{Coefficient, Control};
use serde::Serialize;

/// P and I as multiples of `f = 32767 keFw / 12000`, control steps per count/s: full control at the
/// speed whose back EMF is 12 V. D and F are 0.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Gains {
    /// P / f.
    pub(super) p: f64,
    /// I / f, per second.
    pub(super) i: f64,
}

/// The coefficients of all variants in the first round.
pub(super) const SAME: Gains = Gains { p: 1.5, i: 7.5 };

pub(super) const P: [f64; 6] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0];
pub(super) const I: [f64; 4] = [4.0, 7.5, 11.0, 15.0];

/// The candidates for each variant's best coefficients.
pub(super) const GRID: [Gains; P.len() * I.len()] = {
    let mut grid = [SAME; P.len() * I.len()];
    let mut n = 0;
    while n < grid.len() {
        grid[n] = Gains { p: P[n / I.len()], i: I[n % I.len()] };
        n += 1;
    }
    grid
};

impl Gains {
    /// The coefficients for a motor: an integral is given by cycles of 50 ms.
    pub(super) fn coefficients(self, motor: &Motor) -> Pidf {
        let f = f64::from(Control::MAX.get()) * motor.ke_fw() / 12_000.0;
        // Casts from float saturate.
        let fixed = |factor: f64| Coefficient::from_bits((factor * f * f64::from(1 << 16)).round() as i32);
        Pidf { p: fixed(self.p), i: fixed(self.i / 20.0), d: Coefficient::ZERO, f: Coefficient::ZERO }
    }
}
