//! Formulas that the firmware computes, answered by the firmware's own code.

use super::CaseError;
use super::case::{Case, table};
use crate::with_fields;
use motor_hub::braking::{
    self, LinearCurrent, Location, OperatingPoint, Points, Regime, Scheme, UnboundedControl, Winding,
};
use motor_hub::bridge::{BridgeConstants, Drive};
use motor_hub::model::bridge_states::{CurrentSign, SwitchPattern};
use motor_hub::model::catalogue::Motor;
use motor_hub::model::paper;
use motor_hub::model::si::{Hertz, Ohms, Volts};
use motor_hub::model::switching::{Bridge, Conditions};
use motor_hub::units::{Control, CountsPerSecond, EmfConstant, Inductance, Millivolts, Resistance};
use serde_json::{Value, json};
use simulated::scenario::number_text;
use simulated::scheme::{BlendChoice, SchemeName};
use std::f64::consts::TAU;

/// Speed in counts/s per mV of back EMF, for a back-EMF constant of 1/64 mV s/count. An operating point depends only on
/// the product of speed and constant, so any constant may be used. With this constant the largest back EMF needs the
/// whole range of speeds. No other constant resolves the back EMF finer.
const FINEST: f64 = 64.0;

/// Battery voltage for the printed bridge table, in millivolts.
const BATTERY_MV: i32 = 12_000;
/// Drop of a diode for the printed bridge table, in millivolts.
const DIODE_MV: i32 = 700;
/// Back EMF below the battery voltage for the printed bridge table, in millivolts.
const EMF_MV: i32 = 5_000;
/// Back EMF above the battery voltage for the printed bridge table, in millivolts.
const OVERRUN_MV: i32 = 20_000;

/// Scale of the firmware's back-EMF constant, which has 20 binary places.
const Q20: f64 = (1 << 20) as f64;
/// Largest control value in steps.
const LARGEST_CONTROL: i64 = Control::MAX.get() as i64;
/// Message for a battery voltage that the firmware cannot represent.
const BATTERY: &str = "input Vbat must be 0.001 to 65.535 V";
/// Largest speed that the firmware can represent, in counts/s.
const LARGEST_CPS: i64 = 8_388_607;

/// Default control values of a table for counter-clockwise motion.
const CONTROLS_CCW: [f64; 6] = [-32767.0, -20011.0, -12345.0, -777.0, 7777.0, 32767.0];

/// Default control values of a table.
const CONTROLS: [f64; 12] =
    [-32767.0, -30000.0, -20011.0, -12345.0, -5000.0, -777.0, 0.0, 1234.0, 7777.0, 16384.0, 29000.0, 32767.0];

/// The effect of one of the sixteen switch patterns.
pub(super) fn bridge_state(case: &Case) -> Result<Value, CaseError> {
    let number = case.whole("state", 0, 15)? as u8;
    let pattern = SwitchPattern::new(number).ok_or("a state is 0 to 15")?;
    let effect = |emf_mv| pattern.effect(emf_mv, BATTERY_MV, DIODE_MV).name();
    let outputs = json!({
        "bits": pattern.switches().map(u8::from),
        "short": pattern.is_short_circuit(),
        "cw": effect(EMF_MV),
        "ccw": effect(-EMF_MV),
    });
    if pattern.is_short_circuit() {
        return Ok(outputs);
    }
    let terminal = |sign| {
        pattern.terminal(sign).map(|terminal| {
            json!({
                "Vb_coef": f64::from(terminal.battery),
                "Vd_coef": f64::from(terminal.diode),
                "Ron_count": terminal.switches,
            })
        })
    };
    let more = json!({
        "cw_overrun": effect(OVERRUN_MV),
        "ccw_overrun": effect(-OVERRUN_MV),
        "v_i_pos": terminal(CurrentSign::Positive),
        "v_i_neg": terminal(CurrentSign::Negative),
    });
    Ok(with_fields(outputs, more))
}

/// The back-EMF constant in mV s/count: exact, and as the firmware's number with 20 binary places.
pub(super) fn emf_constant(case: &Case) -> Result<Value, CaseError> {
    let exact = 1000.0 * TAU * case.positive("Ke")? / case.positive("countsPerRev")?;
    let q20 = constant(exact * Q20)?.to_bits();
    Ok(json!({
        "keFw": exact,
        "q20": q20,
        "max_cps_before_int32_overflow_of_cps_times_q20": i32::MAX / q20,
    }))
}

/// The schemes' abscissas from encoder speed and battery voltage. Those of scheme D, and those whose names end in
/// `_q20`, are the firmware's. Others, and quantities in physical units, are computed here in double precision.
pub(super) fn points(case: &Case) -> Result<Value, CaseError> {
    full_range(case)?;
    let cps = case.whole("cps", 0, LARGEST_CPS)?;
    let battery = case.whole("mvBattery", 1, i64::from(u16::MAX))?;
    let emf = constant(case.number("keFw_q20")?)?.emf_within_range(CountsPerSecond::new(cps as i32))?;
    let at = OperatingPoint::new(emf, Millivolts::new(battery as u16)).ok_or(BATTERY)?;
    let formula = |scheme| Points::from_formula(scheme, at);
    let d = formula(Scheme::D(BlendChoice::fixed(case.blend()?)?.0));
    let x = |points: Option<Points>, which: fn(&Points) -> UnboundedControl| {
        points.as_ref().map(which).map(UnboundedControl::to_f64)
    };
    let a_z = x(formula(Scheme::A), |p| p.z);
    let b_t = x(formula(Scheme::B), |p| p.t);
    let c_t = x(formula(Scheme::C), |p| p.t);
    let (emf_mv, battery_mv) = (cps as f64 * case.positive("keFw")?, battery as f64);
    let r = case.positive("R")?;
    let exact = |scheme: paper::Scheme| {
        let at = Conditions { battery: Volts(1e-3 * battery_mv), emf: Volts(1e-3 * emf_mv) };
        scheme.points(LARGEST_CONTROL as f64, Ohms(r), at)
    };
    let amps = |mv: f64| mv * 1e-3 / r;
    Ok(json!({
        "emf_mV": emf_mv,
        "A_xZ": exact(paper::Scheme::A).z.x,
        "B_xT": exact(paper::Scheme::B).t.x,
        "C_xT": exact(paper::Scheme::C).t.x,
        "D_xT": x(d, |p| p.t),
        "D_xS": x(d, |p| p.s),
        "A_xZ_q20": a_z,
        "B_xT_q20": b_t,
        "C_xT_q20": c_t,
        "yG_A": amps(battery_mv - emf_mv),
        "yS_A": amps(-battery_mv - emf_mv),
        "yT_A": amps(-emf_mv),
        "overrun": at.is_overrun(),
        "Omega_rad_s": cps as f64 * TAU / case.positive("countsPerRev")?,
    }))
}

/// Regime and duty of a control value, for points that the case gives.
pub(super) fn example_duty(case: &Case) -> Result<Value, CaseError> {
    let abscissa =
        |key| case.whole(key, -(1 << 37), 1 << 37).map(|steps| UnboundedControl::from_bits(steps << 8));
    let points = Points { s: abscissa("S")?, t: abscissa("T")?, z: abscissa("Z")?, g: abscissa("G")? };
    if !(points.s < points.t && points.t <= points.z && points.z < points.g) {
        return Err("the points must ascend: S < T <= Z < G".into());
    }
    let Location { regime, fraction } = points.locate(control(case.number("control")?)?);
    Ok(json!({ "regime": name(regime), "duty": fraction.to_f64() }))
}

/// Regime, mode and duty of control values at an operating point.
pub(super) fn regime_duty(case: &Case) -> Result<Value, CaseError> {
    full_range(case)?;
    let scheme: SchemeName = case.text("scheme")?.parse()?;
    let blend = if case.has("blend") { Some(BlendChoice::fixed(case.blend()?)?) } else { None };
    let scheme = scheme.with_blend(blend)?;

    let emf = Volts(case.positive("Ke")? * case.number("Omega")?);
    let at = operating_point(Conditions { battery: Volts(case.positive("Vbat")?), emf })?;

    let controls = case
        .column("control")?
        .unwrap_or_else(|| if emf.0 < 0.0 { CONTROLS_CCW.to_vec() } else { CONTROLS.to_vec() });
    // The paper's formulas answer the case. At overrun, and where a formula is not defined, the firmware's points
    // answer it.
    let points = match Points::from_formula(scheme, at) {
        Some(points) if !at.is_overrun() => points,
        _ => Points::new(scheme, at),
    };
    let row = |value: f64| {
        let placed = control(value)?;
        let turned = if at.counter_clockwise() { placed.reversed() } else { placed };
        let Location { regime, fraction } = points.locate(turned);
        let mode = regime.mode(at.counter_clockwise());
        Ok(json!([placed.get(), name(regime), mode.name(), fraction.to_duty().to_f64()]))
    };
    table(&["control", "regime", "mode", "duty"], controls.into_iter().map(row))
}

/// Returns the bridge command by which the firmware makes the mean current `wanted`, in amperes, in Scheme A. The
/// control value is rounded. Therefore the error of the current is below 1/32767 of Vbat/R.
pub(super) fn current_drive(
    motor: &Motor,
    bridge: Bridge,
    frequency: Hertz,
    at: Conditions,
    wanted: f64,
) -> Result<Drive, CaseError> {
    // Casts from float saturate. A saturated value is out of range and is refused.
    let winding = Winding {
        emf: constant(Q20 / FINEST)?,
        resistance: Resistance::from_ohms(motor.r.0)?,
        inductance: Some(Inductance::from_millihenries(1e3 * motor.l.0)?),
    };
    let bridge_constants = BridgeConstants::new(
        (1e3 * bridge.vd.0).round() as u16,
        (1e3 * bridge.ron.0).round() as u16,
        frequency.0.round() as u32,
    )?;
    let current = LinearCurrent::new(&winding, &bridge_constants);
    let point = operating_point(at)?;
    let voltage = at.emf.0 + wanted * (motor.r.0 + 2.0 * bridge.ron.0);
    let control = Control::saturating((voltage / at.battery.0 * LARGEST_CONTROL as f64).round() as i64);
    Ok(braking::linear_current(&current, Scheme::A, point, control))
}

fn full_range(case: &Case) -> Result<(), CaseError> {
    if case.has("cMax") {
        case.whole("cMax", LARGEST_CONTROL, LARGEST_CONTROL)?;
    }
    Ok(())
}

fn constant(bits: f64) -> Result<EmfConstant, CaseError> {
    // A cast from float saturates. A saturated value is out of range and is refused.
    Ok(EmfConstant::from_bits(bits.round() as i32)?)
}

/// The firmware's operating point for these conditions. A voltage that the firmware cannot represent is refused.
fn operating_point(at: Conditions) -> Result<OperatingPoint, CaseError> {
    // A speed beyond its range is limited to the range. The back EMF of such a speed is refused.
    let speed = CountsPerSecond::saturating_from_bits((1e3 * at.emf.0 * FINEST * 256.0).round() as i64);
    let emf = constant(Q20 / FINEST)?.emf_within_range(speed)?;
    let battery = Millivolts::from_volts(at.battery.0).map_err(|_| BATTERY)?;
    Ok(OperatingPoint::new(emf, battery).ok_or(BATTERY)?)
}

fn control(value: f64) -> Result<Control, CaseError> {
    if value.fract() == 0.0 && value.abs() <= LARGEST_CONTROL as f64 {
        Ok(Control::new(value as i16))
    } else {
        Err(format!("control {} must be a whole number from -32767 to 32767", number_text(value)).into())
    }
}

/// The document's word for a regime.
fn name(regime: Regime) -> &'static str {
    match regime {
        Regime::Braking => "brake",
        regime => regime.name(),
    }
}
