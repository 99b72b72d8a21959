//! Writes a random scenario as a scenario file.

use super::friction_percent;
use motor_hub::braking::DutyRule;
use motor_hub::motor::Setpoint;
use serde_json::{Value, json};
use simulated::scenario::{Motor, Scenario, Timed};
use simulated::scheme::SchemeWords;

/// A random scenario in TOML. Parts that random scenarios do not have are left out.
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
            "unlimited": scenario.unlimited,
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
        "configured": motor.configuration,
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
        Setpoint::Velocity(speed) => json!({ "at_s": at_s, "velocity_cps": speed.round() }),
        Setpoint::Position { target, tolerance, speed_limit } => json!({
            "at_s": at_s,
            "position_counts": target,
            "tolerance_counts": tolerance,
            "speed_limit_cps": speed_limit.round(),
        }),
        _ => json!({ "at_s": at_s, "disable": true }),
    }
}
