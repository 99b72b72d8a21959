//! A scenario as the file that it could have come from.

use super::friction_percent;
use motor_hub::braking::{Blend, BlendFraction, DutyRule, Scheme};
use motor_hub::motor::{OnFault, Setpoint, ZeroPower};
use motor_hub::units::Control;
use simulated::hardware::REAL_BRIDGE;
use simulated::scenario::{Configuration, Motor, Scenario, UNLIMITED};
use std::fmt::Write;

/// The scenario in TOML; what has no place in a survey (coefficients, expectations, a battery that runs down) is
/// left out.
pub fn toml(scenario: &Scenario) -> String {
    let Scenario { name, duration_s, period, seed, battery, .. } = scenario;
    let mut out = format!(
        "name = {name:?}\nduration_s = {duration_s:?}\ncontrol_period_ms = {}\nseed = {seed}\n\n\
         [battery]\nemf_v = {:?}\nresistance_ohm = {:?}\nunlimited = {}\n",
        period.as_millis(),
        battery.emf.0,
        battery.resistance.0,
        scenario.limits == UNLIMITED,
    );
    for motor in &scenario.motors {
        // Writing to a string does not fail.
        let _ = table(&mut out, motor);
    }
    out
}

fn table(out: &mut String, motor: &Motor) -> std::fmt::Result {
    let constants = &motor.constants;
    let inertia = if constants.j == constants.j_rotor_measured { "rotor" } else { "paper" };
    writeln!(out, "\n[[motors]]\nlabel = {:?}\nmotor = {:?}", motor.label, constants.name)?;
    writeln!(out, "inertia = {inertia:?}\n{}", scheme(motor.scheme))?;
    let friction = friction_percent(motor);
    if friction > 0.0 {
        writeln!(out, "friction = {{ coulomb_percent = {friction:?} }}")?;
    }
    if motor.duty == DutyRule::LinearDuty {
        writeln!(out, "duty = \"linear-duty\"")?;
    }
    if let Some(limit) = motor.thermal {
        let (ma, winding_s, case_s) = (limit.continuous_ma(), limit.winding_s(), limit.case_s());
        let amperes = f64::from(ma) / 1e3;
        writeln!(
            out,
            "thermal = {{ continuous_a = {amperes}, winding_s = {winding_s}, case_s = {case_s} }}"
        )?;
    }
    if motor.bridge == REAL_BRIDGE {
        writeln!(out, "bridge = \"vnh5019\"")?;
    }
    if motor.on_fault == OnFault::Brake {
        writeln!(out, "on_fault = \"brake\"")?;
    }
    if motor.zero_power == ZeroPower::Float {
        writeln!(out, "zero_power = \"float\"")?;
    }
    let Configuration { resistance, emf, motion, .. } = motor.configuration;
    match motion {
        None => writeln!(out, "configured = \"nothing\"")?,
        Some(motion) => writeln!(
            out,
            "configured = {{ resistance = {resistance:?}, emf = {emf:?}, inertia = {:?}, drag = {:?}, friction = {:?} }}",
            motion.inertia, motion.drag, motion.friction
        )?,
    }
    writeln!(
        out,
        "load = {{ inertia_kg_m2 = {:?}, drag_nms_per_rad = {:?}, torque_nm = {:?} }}",
        motor.load.inertia_after.0,
        motor.load.drag_after.0,
        motor.torque_at(0.0)
    )?;
    writeln!(out, "setpoints = [")?;
    for timed in &motor.setpoints {
        writeln!(out, "    {{ at_s = {:?}, {} }},", timed.at_s, setpoint(timed.value))?;
    }
    writeln!(out, "]\ntorques = [")?;
    for timed in motor.torques.iter().filter(|timed| timed.at_s > 0.0) {
        writeln!(out, "    {{ at_s = {:?}, torque_nm = {:?} }},", timed.at_s, timed.value)?;
    }
    writeln!(out, "]")
}

fn scheme(scheme: Scheme) -> String {
    match scheme {
        Scheme::ForwardReverse => "scheme = \"none\"".to_owned(),
        Scheme::A => "scheme = \"A\"".to_owned(),
        Scheme::B => "scheme = \"B\"".to_owned(),
        Scheme::C => "scheme = \"C\"".to_owned(),
        Scheme::D(Blend::Automatic) => "scheme = \"D\"".to_owned(),
        Scheme::D(Blend::Fixed(blend)) => {
            let share = f64::from(blend.to_bits()) / f64::from(BlendFraction::ONE.to_bits());
            format!("scheme = \"D\"\nblend = {share:?}")
        }
    }
}

fn setpoint(setpoint: Setpoint) -> String {
    match setpoint {
        // A survey has none of the last two.
        Setpoint::Disabled | Setpoint::FailSafe | Setpoint::Identify { .. } | Setpoint::Together(_) => {
            "disable = true".to_owned()
        }
        Setpoint::ConstantPower(power) => {
            format!("power = {:?}", f64::from(power.get()) / f64::from(Control::MAX.get()))
        }
        Setpoint::Current { current, speed_limit } => {
            format!("current_a = {:?}, speed_limit_cps = {}", current.to_amperes(), speed_limit.round())
        }
        Setpoint::Velocity(speed) => format!("velocity_cps = {}", speed.round()),
        Setpoint::Position { target, tolerance, speed_limit } => format!(
            "position_counts = {target}, tolerance_counts = {tolerance}, speed_limit_cps = {}",
            speed_limit.round()
        ),
    }
}
