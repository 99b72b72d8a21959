//! Numbers that the paper and its revision print, computed anew for the motor of their examples.

use super::case::Case;
use motor_hub::braking::{Abscissa, Points};
use motor_hub::model::catalogue::{Motor, find};
use motor_hub::model::load::Load;
use motor_hub::model::response::{Applied, GearedMotor, Poles};
use motor_hub::model::si::{Kilograms, Metres, NewtonMetres, RadPerSec, Seconds, Volts};
use motor_hub::units::Control;
use serde_json::{Value, json};

/// A printed number by its name: as printed, and as computed here.
pub(super) fn printed(case: &Case) -> Result<Value, String> {
    let motor = find("AM 60 A").and_then(|entry| entry.motor).ok_or("the catalogue lacks the AM 60 A")?;
    let (printed, computed) = value(case.text("name")?, &motor)?;
    Ok(json!({ "printed": printed, "computed": computed }))
}

/// Where each printed number stands, and its name.
pub(crate) const PRINTED: [(&str, &str); 20] = [
    ("2.2.2", "vapp0 per Omega, post-gearbox"),
    ("2.2.2", "vg per Omega, post-gearbox"),
    ("2.2.2", "vapp0 at Omega=2 post"),
    ("2.2.2", "dv to vg at Omega=2 post"),
    ("2.2.3", "vapp0 at Omega=1 post"),
    ("2.2.3", "mean-zero-current drop, Omega=1 post, 50 ms"),
    ("2.3", "max velocity 12 V post"),
    ("revision, 2.2.2", "vapp0 per Omega, pre-gearbox"),
    ("revision, 2.2.2", "vg per Omega, pre-gearbox"),
    ("revision, 2.2.3", "vapp0 at Omega=1 pre"),
    ("revision, 2.2.3", "mean-zero-current drop, Omega=1 pre, 50 ms"),
    ("revision, 2.3", "max velocity 12 V pre"),
    ("revision", "keFw"),
    ("revision, 1.3", "brake duty of the example points at -10000"),
    ("modelling paper", "steady current 12 V"),
    ("modelling paper", "slow pole"),
    ("modelling paper", "fast pole"),
    ("time constants", "slow time constant, 5 kg flywheel"),
    ("time constants", "fast time constant, 5 kg flywheel"),
    ("time constants", "L->0 time constant"),
];

/// A printed number: as printed, and as computed for the motor of the paper's examples.
pub(crate) fn value(name: &str, motor: &Motor) -> Result<(&'static str, f64), String> {
    let flywheel = |kg| GearedMotor::new(motor, &Load::flywheel(Kilograms(kg), Metres(0.1)));
    let geared = flywheel(10.0);
    // Speeds "post" are those of the output shaft, "pre" those of the motor shaft.
    let post = |omega: f64| RadPerSec(omega * motor.gear_ratio);
    let voltage = |speed| geared.steady_voltage(speed, NewtonMetres(0.0)).0;
    let emf = |speed| geared.emf(speed).0;
    let drop = |speed| geared.voltage_drop(speed, Seconds(0.05)).mean_zero_change.0;
    let free = geared.steady(Applied::voltage(Volts(12.0)));
    let pre = RadPerSec(1.0);
    let poles = |geared: GearedMotor| match geared.poles() {
        Poles::Real { slow, fast } => Ok((slow, fast)),
        Poles::Complex { .. } => Err("the example motor does not oscillate".to_owned()),
    };
    Ok(match name {
        "vapp0 per Omega, post-gearbox" => ("314339/266500", voltage(post(1.0))),
        "vg per Omega, post-gearbox" => ("533/500", emf(post(1.0))),
        "vapp0 at Omega=2 post" => ("314339/133250", voltage(post(2.0))),
        "dv to vg at Omega=2 post" => ("-121/533", emf(post(2.0)) - voltage(post(2.0))),
        "vapp0 per Omega, pre-gearbox" => ("314339/15990000", voltage(pre)),
        "vg per Omega, pre-gearbox" => ("533/30000", emf(pre)),
        "vapp0 at Omega=1 post" => ("1.17951", voltage(post(1.0))),
        "mean-zero-current drop, Omega=1 post, 50 ms" => ("-0.132111", drop(post(1.0))),
        "vapp0 at Omega=1 pre" => ("0.0196585", voltage(pre)),
        "mean-zero-current drop, Omega=1 pre, 50 ms" => ("-0.00220185", drop(pre)),
        "max velocity 12 V post" => ("10.1737", free.speed.0 / motor.gear_ratio),
        "max velocity 12 V pre" => ("610.424", free.speed.0),
        "steady current 12 V" => ("0.349941", free.current.0),
        "slow pole" => ("-6.86584", -poles(geared)?.0),
        "fast pole" => ("-4748.84", -poles(geared)?.1),
        "slow time constant, 5 kg flywheel" => ("0.072744", 1.0 / poles(flywheel(5.0))?.0),
        "fast time constant, 5 kg flywheel" => ("0.000210854", 1.0 / poles(flywheel(5.0))?.1),
        "L->0 time constant" => ("0.0729347", flywheel(5.0).tau_m().0),
        "keFw" => ("3.98683", motor.ke_fw()),
        "brake duty of the example points at -10000" => ("0.740234", example_duty()),
        other => return Err(format!("no printed number is called {other:?}")),
    })
}

/// The paper's example points (section 1.3), on the firmware's core.
fn example_duty() -> f64 {
    let at = |counts: i64| Abscissa::from_bits(counts << 8);
    let points = Points { s: at(-32767), t: at(-16384), z: at(8192), g: at(32767) };
    points.place(Control::new(-10_000)).fraction.to_f64()
}
