//! Compares every number that the paper prints with the number computed here, and lists the misprints of the paper.

pub(crate) mod printed;

use crate::page::Page;
use crate::{StudyError, table};
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::model::load::Load;
use motor_hub::model::response::{Applied, GearedMotor};
use motor_hub::model::si::{Amps, Kilograms, Metres, RadPerSec, Seconds, Volts};
use printed::{Number, numbers};
use serde::Serialize;

#[derive(Serialize)]
struct Misprint {
    section: &'static str,
    printed: &'static str,
    right: String,
}

/// Errors of two estimates of the mean current over a control period. The paper leaves a better estimate as a to-do.
/// One estimate is `(v - Ke Omega)/R`; the other one includes the change of speed. The errors are rms values over
/// speeds and voltages.
#[derive(Serialize)]
struct Estimate {
    motor: &'static str,
    load: &'static str,
    period_ms: f64,
    quasistatic_rms_a: f64,
    estimate_rms_a: f64,
    ke_ratio: f64,
}

/// The whole comparison with the paper.
#[derive(Serialize)]
pub struct Document {
    numbers: [Number; 20],
    misprints: Vec<Misprint>,
    estimates: Vec<Estimate>,
}

impl Document {
    /// Computes all numbers.
    ///
    /// # Errors
    /// If the catalogue lacks a motor of the paper's examples.
    pub fn new() -> Result<Self, StudyError> {
        let motor = characterised("AM 60 A")?;
        Ok(Self { numbers: numbers(&motor), misprints: misprints(&motor), estimates: estimates()? })
    }

    /// The comparison as tables, for a terminal.
    pub fn text(&self) -> String {
        let mut numbers = table::new(&["section", "number", "printed", "ours", "agrees"], 2);
        for n in &self.numbers {
            let agrees = if n.agrees { "yes" } else { "NO" };
            numbers.add_row([n.section, n.name, n.printed, &format!("{:.9}", n.ours), agrees]);
        }
        let mut misprints = table::new(&["section", "printed", "right"], 3);
        for m in &self.misprints {
            misprints.add_row([m.section, m.printed, &m.right]);
        }
        let mut estimates = table::new(
            &["motor", "load", "period", "(v - Ke Omega)/R, rms error", "estimate", "Ke_eff/Ke"],
            2,
        );
        for e in &self.estimates {
            estimates.add_row([
                e.motor.to_owned(),
                e.load.to_owned(),
                format!("{:.0} ms", e.period_ms),
                format!("{:.4} A", e.quasistatic_rms_a),
                format!("{:.4} A", e.estimate_rms_a),
                format!("{:.4}", e.ke_ratio),
            ]);
        }
        let agree = self.numbers.iter().filter(|number| number.agrees).count();
        let mut page = Page::new(format!(
            "{agree} of {} numbers that the paper prints agree with ours; its text has {} misprints.",
            self.numbers.len(),
            self.misprints.len()
        ));
        page.table("Numbers of the paper (its AM 60 is a NeveRest 60)", numbers);
        page.table("Misprints", misprints);
        page.table(
            "A better estimate of the current over a control period (the paper's second to-do)",
            estimates,
        );
        page.text(ESTIMATE);
        page.terminal()
    }
}

/// Explains the estimate of the current below its table.
const ESTIMATE: &str = "\
The estimate includes the change of speed within the period: i_inf + (i_q - i_inf) phi + (i0 - i_q) tau_e/P.
It scales all ordinates of a scheme by one factor, and moves the abscissas by Ke_eff/Ke, which is a few percent. The
current is much more accurate; the control value hardly changes.";

/// The paper's flywheel: 10 kg, 10 cm.
fn flywheel() -> Load {
    Load::flywheel(Kilograms(10.0), Metres(0.1))
}

fn misprints(motor: &Motor) -> Vec<Misprint> {
    // Freewheeling over one diode: L i' + R i + e + Vd = 0, from i to 0.
    let tau = motor.l.0 / motor.r.0;
    let decay_us = |i: f64, emf: f64| 1e6 * tau * (i * motor.r.0 / (emf + 0.7)).ln_1p();
    let geared = GearedMotor::new(motor, &flywheel());
    let one = RadPerSec(motor.gear_ratio);
    let drop = geared.voltage_drop(one, Seconds(0.05));
    let start = geared.steady(Applied::voltage(drop.before));
    let at = |ms: f64| geared.after(start, Applied::voltage(drop.emf), Seconds(1e-3 * ms)).current.0;
    let lowest = (1..5000).map(|n| 0.01 * f64::from(n)).min_by(|a, b| at(*a).total_cmp(&at(*b)));
    let lowest = lowest.unwrap_or_default();
    let emf_of_free = motor.ke.0 * geared.steady(Applied::voltage(Volts(12.0))).speed.0;
    let fixed = |section, printed, right: &str| Misprint { section, printed, right: right.to_owned() };
    vec![
        fixed(
            "1.2",
            "rows of the short-circuit states print 0000",
            "12 is 1100, 3 is 0011, 7 is 0111, 11 is 1011, 13 is 1101, 14 is 1110, 15 is 1111",
        ),
        fixed("1.2", "brake in 8, 4, 2, 1", "needs a back EMF above the drop of one diode"),
        fixed(
            "1.2",
            "coast in 0, 8, 4, 2, 1",
            "holds below the battery voltage and the diodes in the path; above, the motor regenerates",
        ),
        fixed("1.2", "from 9 to 8 the current discharges across D1", "it freewheels over S1 and D3"),
        Misprint {
            section: "1.2",
            printed: "discharges briefly, about 1 ms",
            right: format!(
                "1 to 3 A of a NeveRest 60 take {:.0} us (1 A, free speed) to {:.0} us (3 A, standstill)",
                decay_us(1.0, emf_of_free),
                decay_us(3.0, 0.0)
            ),
        },
        fixed("1.1, 1.3", "VN5050E", "VNH5050E"),
        fixed(
            "1.3",
            "5/0 is rheostatic braking",
            "it is a boost chopper: the current in state 0 charges the battery",
        ),
        fixed(
            "1.3",
            "6/2 at 0 % is full dynamic braking",
            "only above a back EMF of one diode drop, and less by that drop",
        ),
        fixed("2.1, 2.3", "points F and R", "G and S"),
        fixed("2.2.2", "R in kg m2/(s2 A)", "s3: kg m2/(s3 A2) is an ohm"),
        fixed("2.2.2", "vappFromVelocity: equation == 0", "== Omega"),
        fixed("2.2.2", "a 10 kg or a 1 kg flywheel", "only 10 kg is used"),
        fixed("2.2.2", "current without external torque: exp(+t ...)", "exp(-t ...): the sign is lost"),
        fixed(
            "2.2.2",
            "full current: factor of the first term Delta v_app",
            "Delta tau_app; and the second exponential of each pair has + sqrt",
        ),
        Misprint {
            section: "2.2.2",
            printed: "recovers some ~20 % of its initial value in 50 ms",
            right: format!(
                "{:.1} %; the least is {:.2} % at {lowest:.2} ms, so it never reaches zero, as said",
                100.0 * at(50.0) / at(0.0),
                100.0 * at(lowest) / at(0.0)
            ),
        },
        fixed(
            "2.2.3",
            "exponent pidPeriod (Bafter L - Jafter R)(B L + J R) eta N^2",
            "a sum: pidPeriod (Bafter L + Jafter R + (B L + J R) eta N^2) / (2 L (Jafter + J eta N^2)); Omega stands outside the root",
        ),
        fixed("3.1", "the y axis of Scheme B is torque", "it is current"),
        fixed("3.1", "example: yReverse100 -> -yMax/2", "-yMax"),
        fixed("3.2", "instantaneous current velocity", "instantaneous angular velocity"),
        fixed(
            "all",
            "formulas hold for any Omega",
            "for Omega >= 0; mirror for the rest, and at 0 T and Z coincide",
        ),
    ]
}

fn estimates() -> Result<Vec<Estimate>, StudyError> {
    let mut rows = Vec::new();
    for (name, load_name, load) in [
        ("NeveRest 60", "10 kg flywheel", flywheel()),
        ("NeveRest 60", "none", Load::NONE),
        ("NeveRest 20", "none", Load::NONE),
        ("NeveRest 3.7", "none", Load::NONE),
    ] {
        let motor = characterised(name)?;
        let motor = if load == Load::NONE { motor.with_measured_rotor_inertia() } else { motor };
        let geared = GearedMotor::new(&motor, &load);
        for period_ms in [10.0, 50.0] {
            rows.push(estimate(&motor, &geared, load_name, period_ms));
        }
    }
    Ok(rows)
}

fn estimate(motor: &Motor, geared: &GearedMotor, load: &'static str, period_ms: f64) -> Estimate {
    let period = Seconds(1e-3 * period_ms);
    let (mut quasistatic, mut better, mut cases) = (0.0, 0.0, 0.0);
    let free = geared.steady(Applied::voltage(Volts(12.0))).speed.0;
    for u in [0.1, 0.3, 0.5, 0.7, 0.9] {
        let speed = RadPerSec(u * free);
        let start = geared
            .steady(Applied::voltage(geared.steady_voltage(speed, motor_hub::model::si::NewtonMetres(0.0))));
        for volts in (-12..=12).step_by(3).map(f64::from).map(Volts) {
            let exact: Amps = geared.mean(start, Applied::voltage(volts), period).current;
            quasistatic += (geared.quasistatic_current(speed, volts).0 - exact.0).powi(2);
            better += (geared.mean_current_estimate(start, volts, period).0 - exact.0).powi(2);
            cases += 1.0;
        }
    }
    let drop = geared.voltage_drop(RadPerSec(1.0), period);
    Estimate {
        motor: motor.name,
        load,
        period_ms,
        quasistatic_rms_a: f64::sqrt(quasistatic / cases),
        estimate_rms_a: f64::sqrt(better / cases),
        ke_ratio: drop.mean_zero_voltage.0 / drop.emf.0,
    }
}
