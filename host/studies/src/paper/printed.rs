//! Numbers that the paper and its revision print, and the numbers computed here for the motor of their examples.

use motor_hub::braking::{Points, UnboundedControl};
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::Load;
use motor_hub::model::response::{Applied, GearedMotor, Motion, Poles};
use motor_hub::model::si::{Kilograms, Metres, NewtonMetres, RadPerSec, Seconds, Volts};
use motor_hub::units::Control;
use serde::Serialize;

/// A number that the paper prints.
#[derive(Serialize)]
pub(crate) struct Number {
    pub(crate) section: &'static str,
    pub(crate) name: &'static str,
    pub(crate) printed: &'static str,
    /// The number as computed here.
    pub(crate) ours: f64,
    /// True if both numbers agree to the last printed digit. A printed fraction must agree with a relative error of at
    /// most 1e-12.
    pub(crate) agrees: bool,
}

fn number(section: &'static str, name: &'static str, printed: &'static str, ours: f64) -> Number {
    let agrees = if let Some((over, under)) = printed.split_once('/') {
        match (over.parse::<f64>(), under.parse::<f64>()) {
            (Ok(over), Ok(under)) => (over / under - ours).abs() <= 1e-12 * ours.abs(),
            _ => false,
        }
    } else {
        let decimals = printed.split_once('.').map_or(0, |(_, digits)| digits.len());
        let half_digit = 0.5 * 10f64.powi(-(decimals as i32));
        printed.parse::<f64>().is_ok_and(|value| (value - ours).abs() <= half_digit)
    };
    Number { section, name, printed, ours, agrees }
}

/// All numbers that the paper prints, computed for the motor of the paper's examples. Speeds "post" are of the output
/// shaft, "pre" of the motor shaft.
pub(crate) fn numbers(m: &Motor) -> [Number; 20] {
    [
        number("2.2.2", "vapp0 per Omega, post-gearbox", "314339/266500", voltage(m, post(m, 1.0))),
        number("2.2.2", "vg per Omega, post-gearbox", "533/500", emf(m, post(m, 1.0))),
        number("2.2.2", "vapp0 at Omega=2 post", "314339/133250", voltage(m, post(m, 2.0))),
        number(
            "2.2.2",
            "dv to vg at Omega=2 post",
            "-121/533",
            emf(m, post(m, 2.0)) - voltage(m, post(m, 2.0)),
        ),
        number("2.2.3", "vapp0 at Omega=1 post", "1.17951", voltage(m, post(m, 1.0))),
        number("2.2.3", "mean-zero-current drop, Omega=1 post, 50 ms", "-0.132111", drop(m, post(m, 1.0))),
        number("2.3", "max velocity 12 V post", "10.1737", free(m).speed.0 / m.gear_ratio),
        number("revision, 2.2.2", "vapp0 per Omega, pre-gearbox", "314339/15990000", voltage(m, PRE)),
        number("revision, 2.2.2", "vg per Omega, pre-gearbox", "533/30000", emf(m, PRE)),
        number("revision, 2.2.3", "vapp0 at Omega=1 pre", "0.0196585", voltage(m, PRE)),
        number("revision, 2.2.3", "mean-zero-current drop, Omega=1 pre, 50 ms", "-0.00220185", drop(m, PRE)),
        number("revision, 2.3", "max velocity 12 V pre", "610.424", free(m).speed.0),
        number("revision", "keFw", "3.98683", m.ke_fw()),
        number("revision, 1.3", "brake duty of the example points at -10000", "0.740234", example_duty()),
        number("modelling paper", "steady current 12 V", "0.349941", free(m).current.0),
        number("modelling paper", "slow pole", "-6.86584", -poles(m, 10.0).0),
        number("modelling paper", "fast pole", "-4748.84", -poles(m, 10.0).1),
        number("time constants", "slow time constant, 5 kg flywheel", "0.072744", 1.0 / poles(m, 5.0).0),
        number("time constants", "fast time constant, 5 kg flywheel", "0.000210854", 1.0 / poles(m, 5.0).1),
        number("time constants", "L->0 time constant", "0.0729347", with_flywheel(m, 5.0).tau_m().0),
    ]
}

/// 1 rad/s of the motor shaft.
const PRE: RadPerSec = RadPerSec(1.0);

/// Speed of the motor shaft, from a speed of the output shaft in rad/s.
fn post(motor: &Motor, omega: f64) -> RadPerSec {
    RadPerSec(omega * motor.gear_ratio)
}

/// A motor with a flywheel of this mass, which has the paper's radius of 10 cm.
fn with_flywheel(motor: &Motor, kg: f64) -> GearedMotor {
    GearedMotor::new(motor, &Load::flywheel(Kilograms(kg), Metres(0.1)))
}

fn voltage(motor: &Motor, speed: RadPerSec) -> f64 {
    with_flywheel(motor, 10.0).steady_voltage(speed, NewtonMetres(0.0)).0
}

fn emf(motor: &Motor, speed: RadPerSec) -> f64 {
    with_flywheel(motor, 10.0).emf(speed).0
}

/// The change of voltage that makes the mean current over 50 ms zero.
fn drop(motor: &Motor, speed: RadPerSec) -> f64 {
    with_flywheel(motor, 10.0).voltage_drop(speed, Seconds(0.05)).mean_zero_change.0
}

/// The motion of a motor that runs free on 12 V.
fn free(motor: &Motor) -> Motion {
    with_flywheel(motor, 10.0).steady(Applied::voltage(Volts(12.0)))
}

/// Slow and fast pole in 1/s, both positive; not a number if the motor oscillates. The paper's motor does not
/// oscillate.
fn poles(motor: &Motor, flywheel_kg: f64) -> (f64, f64) {
    match with_flywheel(motor, flywheel_kg).poles() {
        Poles::Real { slow, fast } => (slow, fast),
        Poles::Complex { .. } => (f64::NAN, f64::NAN),
    }
}

/// The duty at -10000 for the paper's example points (section 1.3), computed by the firmware's core.
fn example_duty() -> f64 {
    let at = |steps: i64| UnboundedControl::from_bits(steps << 8);
    let points = Points { s: at(-32767), t: at(-16384), z: at(8192), g: at(32767) };
    points.locate(Control::new(-10_000)).fraction.to_f64()
}
