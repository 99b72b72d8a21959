//! Formulas of motor, load and bridge, answered by the model in double precision.

use super::CaseError;
use super::case::{Case, table};
use super::firmware::current_drive;
use crate::with_fields;
use motor_hub::braking;
use motor_hub::model::catalogue::Motor;
use motor_hub::model::load::Load;
use motor_hub::model::paper::Scheme;
use motor_hub::model::response::{Applied, GearedMotor, Motion, Poles};
use motor_hub::model::si::{Amps, Drag, Hertz, KgM2, NewtonMetres, Ohms, RadPerSec, Seconds, Volts};
use motor_hub::model::switching::{Bridge, Circuit, Conditions, Pwm};
use serde_json::{Value, json};
use simulated::scheme::SchemeName;

/// Default times of a table, in s.
const TIMES: [f64; 8] = [0.0, 1e-5, 2.1e-4, 1e-3, 0.01, 0.05, 0.31, 3.0];
/// Default duties of a table of currents.
const DUTIES: [f64; 8] = [0.0, 0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 1.0];
/// Default duties of a table of free speeds.
const STEADY_DUTIES: [f64; 4] = [0.25, 0.5, 0.75, 1.0];
/// Default voltages of a table, in V.
const VOLTAGES: [f64; 3] = [12.0, 0.0, -12.0];
/// Default currents of a table. Positive numbers are shares of the largest forward current, and negative numbers are
/// shares of the largest current against the motion.
const CURRENT_SHARES: [f64; 8] = [-1.0, -0.6, -0.15, -0.02, 0.02, 0.15, 0.5, 0.9];

/// The points S, T, Z and G of a scheme, not limited to the control range.
pub(super) fn scheme_points(case: &Case) -> Result<Value, CaseError> {
    let name = case.text("scheme")?;
    let scheme = match name.parse::<SchemeName>()?.0 {
        braking::Scheme::A => Scheme::A,
        braking::Scheme::B => Scheme::B,
        braking::Scheme::C => Scheme::C,
        braking::Scheme::D(_) => Scheme::D { blend: case.blend()? },
        braking::Scheme::ForwardReverse => {
            return Err(format!("input scheme = {name:?} must be A, B, C or D").into());
        }
    };
    let emf = Volts(case.positive("Ke")? * case.not_negative("Omega")?);
    let at = Conditions { battery: Volts(case.positive("Vbat")?), emf };
    let points = scheme.points(case.positive("cMax")?, Ohms(case.positive("R")?), at);
    Ok(json!({
        "xS": points.s.x, "yS": points.s.y,
        "xT": points.t.x, "yT": points.t.y,
        "xZ": points.z.x, "yZ": points.z.y,
        "xG": points.g.x, "yG": points.g.y,
        "u": points.u,
        "valid": points.valid,
    }))
}

fn geared(case: &Case) -> Result<(Motor, GearedMotor), CaseError> {
    let motor = case.moving_motor()?;
    let load = Load {
        inertia_after: KgM2(case.not_negative("Jafter")?),
        drag_after: Drag(case.not_negative("Bafter")?),
        ..Load::NONE
    };
    let geared = GearedMotor::new(&motor, &load);
    Ok((motor, geared))
}

/// Inertia, drag, poles, time constants and free running of a motor with its load.
pub(super) fn plant(case: &Case) -> Result<Value, CaseError> {
    let (_, geared) = geared(case)?;
    let (pole1, pole2) = match geared.poles() {
        Poles::Real { slow, fast } => ((-slow, 0.0), (-fast, 0.0)),
        Poles::Complex { decay, frequency } => ((-decay, frequency), (-decay, -frequency)),
    };
    let free = geared.steady(Applied::voltage(Volts(12.0)));
    Ok(json!({
        "Jt": geared.shaft().inertia.0,
        "Bt": geared.shaft().drag.0,
        "sigma": geared.sigma(),
        "gamma2": geared.gamma2(),
        "oscillatory": geared.gamma2() < 0.0,
        "pole1_re": pole1.0, "pole1_im": pole1.1,
        "pole2_re": pole2.0, "pole2_im": pole2.1,
        "tau_m": geared.tau_m().0,
        "tau_e": geared.tau_e().0,
        "free_speed_12V": free.speed.0,
        "no_load_current_12V": free.current.0,
    }))
}

/// Current and speed after a step of voltage and torque from steady state.
pub(super) fn step_response(case: &Case) -> Result<Value, CaseError> {
    let (motor, geared) = geared(case)?;
    let applied =
        |voltage: f64, torque: f64| Applied { voltage: Volts(voltage), torque_after: NewtonMetres(torque) };
    let (voltage, torque) = (case.number("vapp0")?, case.number("tau_app0")?);
    let start = geared.steady(applied(voltage, torque));
    let after = applied(voltage + case.number("dv")?, torque + case.number("dtau")?);
    let row = |t: f64| {
        let Motion { current, speed } = geared.after(start, after, Seconds(t));
        Ok(json!([t, current.0, speed.0, speed.0 / motor.gear_ratio]))
    };
    let times = case.column("t_s")?.unwrap_or(TIMES.to_vec());
    if times.iter().any(|&t| t < 0.0) {
        return Err("t_s must not be negative".into());
    }
    table(&["t_s", "i_A", "omega_rad_s", "omega_after_rad_s"], times.into_iter().map(row))
}

/// Currents and speed within a control period after the voltage drops to the back EMF.
pub(super) fn pid_period(case: &Case) -> Result<Value, CaseError> {
    let (_, geared) = geared(case)?;
    let speed = RadPerSec(case.number("Omega_motor")?);
    let drop = geared.voltage_drop(speed, Seconds(case.positive("P")?));
    Ok(json!({
        "vapp0": drop.before.0,
        "vg": drop.emf.0,
        "i0": drop.current_before.0,
        "mean_i_after_drop_to_vg": drop.mean_current.0,
        "i_end_after_drop_to_vg": drop.end_current.0,
        "dv_mean_zero": drop.mean_zero_change.0,
        "v_mean_zero": drop.mean_zero_voltage.0,
        "omega_end_mean_zero": drop.mean_zero_end_speed.0,
    }))
}

/// Means over a control period at a constant voltage.
pub(super) fn mean_current(case: &Case) -> Result<Value, CaseError> {
    let (_, geared) = geared(case)?;
    let period = Seconds(case.positive("P")?);
    let start = Motion { current: Amps(case.number("i0")?), speed: RadPerSec(case.number("Omega0")?) };
    let row = |v: f64| {
        let mean = geared.mean(start, Applied::voltage(Volts(v)), period);
        let instant = geared.quasistatic_current(start.speed, Volts(v));
        let estimate = geared.mean_current_estimate(start, Volts(v), period);
        Ok(json!([v, mean.current.0, mean.speed.0, instant.0, estimate.0]))
    };
    let voltages = case.column("v")?.unwrap_or(VOLTAGES.to_vec());
    let columns = ["v", "mean_i_exact", "mean_omega_exact", "i_quasistatic", "i_estimate_README"];
    table(&columns, voltages.into_iter().map(row))
}

/// Motor, circuit, PWM frequency and conditions of a bridge.
fn bridge(case: &Case) -> Result<(Motor, Circuit, Hertz, Conditions), CaseError> {
    let motor = case.motor()?;
    let losses = Bridge::lossy(Volts(case.not_negative("Vd")?), Ohms(case.not_negative("Ron")?));
    let speed = if case.has("Omega") { case.number("Omega")? } else { 0.0 };
    let at = Conditions { battery: Volts(case.positive("Vbat")?), emf: Volts(motor.ke.0 * speed) };
    Ok((motor, Circuit::new(&motor, losses), Hertz(case.positive("f_Hz")?), at))
}

/// Duties of a table, each from 0 to 1.
fn duties(case: &Case, default: &[f64]) -> Result<Vec<f64>, CaseError> {
    let duties = case.column("duty")?.unwrap_or(default.to_vec());
    let sound = duties.iter().all(|duty| (0.0..=1.0).contains(duty));
    if sound { Ok(duties) } else { Err("duty must be 0 to 1".into()) }
}

/// Mean currents of the switching bridge at constant speed.
pub(super) fn bridge_pwm(case: &Case) -> Result<Value, CaseError> {
    let (_, circuit, frequency, at) = bridge(case)?;
    let mode = case.mode()?;
    let row = |duty: f64| {
        let steady = circuit.steady(Pwm::new(mode, duty, frequency), at);
        Ok(json!([duty, steady.mean.0, steady.rms.0, steady.battery.0, steady.conduction.name()]))
    };
    let columns = ["duty", "I_mean", "I_rms", "I_bat_mean", "conduction"];
    table(&columns, duties(case, &DUTIES)?.into_iter().map(row))
}

/// Mode and duty for a mean current: exact, by the formula of the README, and by the firmware.
pub(super) fn duty_for_current(case: &Case) -> Result<Value, CaseError> {
    let (motor, circuit, frequency, at) = bridge(case)?;
    let (v, e) = (at.battery.0, at.emf.0);
    if e.abs() >= v {
        return Err("the back EMF must be below the battery voltage".into());
    }
    let resistance = motor.r.0 + 2.0 * circuit.bridge.ron.0;
    let target = |share: f64| share * if share > 0.0 { v - e } else { v + e } / resistance;
    let row = |wanted: f64| {
        let mode = circuit.mode_for_current(Amps(wanted), at).name();
        let exact = circuit.duty_for_current(Amps(wanted), frequency, at);
        let formula = circuit.duty_for_current_formula(Amps(wanted), frequency, at);
        let firmware = current_drive(&motor, circuit.bridge, frequency, at, wanted)?;
        Ok(json!([
            wanted,
            mode,
            exact.duty,
            mode,
            formula.duty,
            firmware.mode.name(),
            firmware.duty.to_f64(),
        ]))
    };
    let targets = case.column("I_target")?.unwrap_or_else(|| CURRENT_SHARES.map(target).to_vec());
    let columns =
        ["I_target", "mode", "duty_exact", "mode_approx", "duty_approx_README", "mode_fw", "duty_fw"];
    table(&columns, targets.into_iter().map(row))
}

/// Free speed at a duty, and the duty from which on the current is never 0 within a PWM period.
pub(super) fn steady_speed(case: &Case) -> Result<Value, CaseError> {
    let (motor, circuit, frequency, at) = bridge(case)?;
    let geared = GearedMotor::new(&motor, &Load::NONE);
    let mode = case.mode()?;
    let row = |duty: f64| {
        let speed = geared.speed_at_duty(circuit.bridge, Pwm::new(mode, duty, frequency), at.battery);
        Ok(json!([duty, speed.0]))
    };
    let outputs = table(&["duty", "omega_rad_s"], duties(case, &STEADY_DUTIES)?.into_iter().map(row))?;
    let continuity = geared.continuity_duty(circuit.bridge, Pwm::new(mode, 0.0, frequency), at.battery);
    Ok(with_fields(outputs, json!({ "continuity_duty": continuity })))
}

/// The crossing from braking to reverse, with a diode's drop and ideal switches.
pub(super) fn reverse0(case: &Case) -> Result<Value, CaseError> {
    let motor = case.motor()?;
    let losses = Bridge::lossy(Volts(case.not_negative("Vd")?), Ohms(0.0));
    let emf = Volts(motor.ke.0 * case.not_negative("Omega")?);
    let at = Conditions { battery: Volts(case.positive("Vbat")?), emf };
    let crossing = Circuit::new(&motor, losses).reverse0(case.positive("cMax")?, at);
    Ok(json!({
        "duty_at_T": crossing.duty_at_t,
        "i_reverse0": crossing.current.0,
        "i_T": crossing.current_at_t.0,
        "controlReverse0_A": crossing.control_a,
        "controlReverse0_B": crossing.control_b,
        "xT_B": crossing.t_of_b,
        "blend_keeping_T_in_range": crossing.blend_keeping_t_in_range,
    }))
}
