//! Writes a scenario as a scenario file.

use super::friction_percent;
use motor_hub::braking::DutyRule;
use motor_hub::motor::{OnFault, Setpoint, ZeroPower};
use motor_hub::units::Control;
use serde_json::{Value, json};
use simulated::hardware::REAL_BRIDGE;
use simulated::scenario::{Motor, Scenario, Timed, UNLIMITED};
use simulated::scheme::SchemeWords;

/// The scenario in TOML. What a survey does not have is left out: coefficients, expectations, a battery that runs down.
pub fn toml(scenario: &Scenario) -> String {
    let Scenario { name, duration_s, period, seed, battery, motors, .. } = scenario;
    let document = json!({
        "name": name,
        "duration_s": duration_s,
        "control_period_ms": period.as_millis(),
        "seed": seed,
        "battery": {
            "emf_v": battery.emf.0,
            "resistance_ohm": battery.resistance.0,
            "unlimited": scenario.limits == UNLIMITED,
        },
        "motors": motors.iter().map(table).collect::<Vec<Value>>(),
    });
    // TOML has a form for every value of the document.
    toml::to_string(&document).unwrap_or_default()
}

fn table(motor: &Motor) -> Value {
    let Motor { label, constants, load, .. } = motor;
    let scheme = json!(SchemeWords(motor.scheme));
    let friction = friction_percent(motor);
    let configuration = motor.configuration;
    let configured = if configuration.is_motion_known { json!(configuration) } else { json!("nothing") };
    let thermal = motor.thermal.map(|limit| {
        let amperes = f64::from(limit.continuous_ma()) / 1e3;
        json!({ "continuous_a": amperes, "winding_s": limit.winding_s(), "case_s": limit.case_s() })
    });
    let torques = motor.torques.iter().filter(|timed| timed.at_s > 0.0);
    let torques = torques.map(|timed| json!({ "at_s": timed.at_s, "torque_nm": timed.value }));
    let mut table = json!({
        "label": label,
        "motor": constants.name,
        "inertia": if constants.j == constants.j_rotor_measured { "rotor" } else { "paper" },
        "scheme": scheme["scheme"],
        "blend": scheme["blend"],
        "friction": (friction > 0.0).then(|| json!({ "coulomb_percent": friction })),
        "duty": (motor.duty == DutyRule::LinearDuty).then_some("linear-duty"),
        "thermal": thermal,
        "bridge": (motor.bridge == REAL_BRIDGE).then_some("vnh5019"),
        "on_fault": (motor.on_fault == OnFault::Brake).then_some("brake"),
        "zero_power": (motor.zero_power == ZeroPower::Float).then_some("float"),
        "configured": configured,
        "load": {
            "inertia_kg_m2": load.inertia_after.0,
            "drag_nms_per_rad": load.drag_after.0,
            "torque_nm": motor.torque_at(0.0),
        },
        "setpoints": motor.setpoints.iter().map(setpoint).collect::<Vec<Value>>(),
        "torques": torques.collect::<Vec<Value>>(),
    });
    // TOML has no null.
    if let Some(fields) = table.as_object_mut() {
        fields.retain(|_, value| !value.is_null());
    }
    table
}

fn setpoint(&Timed { at_s, value }: &Timed<Setpoint>) -> Value {
    match value {
        // A survey has neither identifications nor groups.
        Setpoint::Disabled | Setpoint::FailSafe | Setpoint::Identify { .. } | Setpoint::Follow(_) => {
            json!({ "at_s": at_s, "disable": true })
        }
        Setpoint::ConstantPower(power) => {
            json!({ "at_s": at_s, "power": f64::from(power.get()) / f64::from(Control::MAX.get()) })
        }
        Setpoint::Current { current, speed_limit } => json!({
            "at_s": at_s, "current_a": current.to_amperes(), "speed_limit_cps": speed_limit.round(),
        }),
        Setpoint::Velocity(speed) => json!({ "at_s": at_s, "velocity_cps": speed.round() }),
        Setpoint::Position { target, tolerance, speed_limit } => json!({
            "at_s": at_s,
            "position_counts": target,
            "tolerance_counts": tolerance,
            "speed_limit_cps": speed_limit.round(),
        }),
    }
}
