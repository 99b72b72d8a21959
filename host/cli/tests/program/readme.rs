//! The README's table of the winch is what `run` prints today. `UPDATE_SNAPSHOTS=1` writes the table.

use crate::common::{folder, json, motor_hub};
use serde_json::Value;
use std::path::Path;

const BEGIN: &str = "<!-- the winch, written by a test -->\n";
const END: &str = "<!-- end of the winch -->\n";

#[test]
fn the_winch_in_the_readme_has_the_figures_of_run() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let (scenario, out) = (root.join("boards/simulated/scenarios/winch.toml"), folder("readme-winch"));
    let run = ["run", "--json", "--scenario", scenario.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let run = json(&motor_hub(&run));
    let number = |value: &Value| value.as_f64().expect("a number");
    let [braking, without] = ["as_set", "without_braking_regime"].map(|way| &run["motors"][0][way]);
    let [load, hunts] = [braking, without].map(|way| {
        let responses = way["responses"].as_array().expect("a list");
        responses.iter().find(|response| response["change"] == "torque to 0.8 N m").expect("the load")
    });
    assert!(hunts["settling_s"].is_null());
    let [jerk, jerk_without] = [braking, without].map(|way| number(&way["deceleration_jerk"]["rms_a"]));
    let [energy, energy_without] = [braking, without].map(|way| number(&way["energy_to_battery_j"]));
    let (settling, rms) = (number(&load["settling_s"]), number(&hunts["residual_rms"]));
    let table = format!(
        "| while the load drives it | proportional braking | forward/reverse only |\n\
         |---|---|---|\n\
         | back at its speed after | {settling:.2} s | never: it hunts, {rms:.0} counts/s rms |\n\
         | current jumps between periods while slowing down, rms | {jerk:.2} A | {jerk_without:.2} A |\n\
         | energy back into the battery | {energy:.1} J | {energy_without:.1} J |\n"
    );
    let readme = std::fs::read_to_string(root.join("README.md")).unwrap();
    let (before, rest) = readme.split_once(BEGIN).expect("the table begins");
    let (old, after) = rest.split_once(END).expect("the table ends");
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some_and(|value| value == "1") {
        return std::fs::write(root.join("README.md"), [before, BEGIN, &table, END, after].concat()).unwrap();
    }
    assert_eq!(old, table, "UPDATE_SNAPSHOTS=1 cargo test -p motor-hub-cli --test program readme writes it");
}
