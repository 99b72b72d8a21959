//! The physics, compared with values that were computed by other programs and methods.

mod bus;
mod friction;
mod physics;
mod train;

use motor_hub::bridge::BridgeConstants;
use motor_hub::model::catalogue::{self, Motor};
use motor_hub::model::switching::Bridge;

const BATTERY: f64 = 12.0;
const BRIDGE: Bridge = Bridge::new(BridgeConstants::IDEAL);

fn motor(name: &str) -> Motor {
    catalogue::characterised(name).expect("in the catalogue")
}

/// A NeveRest 60 with the inertia that was measured at its rotor.
fn am60() -> Motor {
    motor("AM 60 A").with_measured_rotor_inertia()
}

fn close(got: f64, want: f64, tolerance: f64, what: impl std::fmt::Debug) {
    assert!((got - want).abs() <= tolerance, "{what:?}: {got} instead of {want}");
}

/// One Runge-Kutta step of fourth order.
fn rk4<const N: usize>(x: [f64; N], h: f64, slope: impl Fn([f64; N]) -> [f64; N]) -> [f64; N] {
    let ahead = |k: [f64; N], h: f64| std::array::from_fn(|n| x[n] + h * k[n]);
    let k1 = slope(x);
    let k2 = slope(ahead(k1, 0.5 * h));
    let k3 = slope(ahead(k2, 0.5 * h));
    let k4 = slope(ahead(k3, h));
    std::array::from_fn(|n| x[n] + h / 6.0 * (k1[n] + 2.0 * k2[n] + 2.0 * k3[n] + k4[n]))
}
