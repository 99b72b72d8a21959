//! The README's table of the winch is what `run` prints today.
#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a failed access is a failed test"
)]

use crate::common::{folder, motor_hub};
use serde_json::Value;
use std::path::Path;

const README: &str = include_str!("../../../../README.md");

#[test]
fn the_winch_in_the_readme_is_as_run_prints_it() {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../boards/simulated/scenarios/winch.toml");
    let out = folder("readme-winch");
    let run = ["run", "--json", "--scenario", scenario.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let run: Value = serde_json::from_slice(&motor_hub(&run).stdout).expect("one JSON document");
    let number = |value: &Value| value.as_f64().expect("a number");
    let [braking, without] = ["as_set", "without_braking_regime"].map(|way| &run["motors"][0][way]);
    let [load, hunts] = [braking, without].map(|way| {
        let responses = way["responses"].as_array().expect("a list");
        responses.iter().find(|response| response["change"] == "torque to 0.8 N m").expect("the load")
    });
    assert!(hunts["settling_s"].is_null());
    let jerk = |way: &Value| number(&way["deceleration_jerk"]["rms_a"]);
    let energy = |way: &Value| number(&way["energy_to_battery_j"]);
    for row in [
        format!(
            "| back at its speed after | {:.2} s | never: it hunts, {:.0} counts/s rms |",
            number(&load["settling_s"]),
            number(&hunts["residual_rms"])
        ),
        format!(
            "| current jumps between periods while slowing down, rms | {:.2} A | {:.2} A |",
            jerk(braking),
            jerk(without)
        ),
        format!("| energy back into the battery | {:.1} J | {:.1} J |", energy(braking), energy(without)),
    ] {
        assert!(README.contains(&row), "README.md does not have: {row}");
    }
}
