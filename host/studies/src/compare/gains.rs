//! Coefficients of the speed loop, normalised to the motor's speed at a back EMF of 12 V.

use motor_hub::model::catalogue::Motor;
use motor_hub::motion::Pidf;
use motor_hub::units::{Coefficient, Control};
use serde::Serialize;

/// P and I as multiples of `f = 32767 keFw / 12000`, in control steps per count/s. If P is `f`, an error as large as
/// the speed whose back EMF is 12 V gives full control. D and F are 0.
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
