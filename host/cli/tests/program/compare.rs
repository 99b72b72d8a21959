//! `motor-hub compare`: the tasks show the differences between the variants.

use crate::common::{folder, json, motor_hub};
use serde_json::Value;
use std::path::Path;
use std::sync::LazyLock;

/// The quick comparison, made once.
static QUICK: LazyLock<Value> = LazyLock::new(|| {
    json(&motor_hub(&["compare", "--quick", "--json", "--out", folder("compare").to_str().unwrap()]))
});

/// A number of one variant at one task, with the same coefficients for all; null is infinity.
fn number(task: &str, variant: &str, key: &str) -> f64 {
    let find = |list: &Value, key: &str, name: &str| {
        list.as_array().unwrap().iter().find(|entry| entry[key] == name).expect(name).clone()
    };
    let task = find(&QUICK["rounds"][0]["tasks"], "key", task);
    find(&task["rows"], "variant", variant)[key].as_f64().unwrap_or(f64::INFINITY)
}

#[test]
fn linear_current_settles_several_times_sooner_than_linear_duty() {
    let [linear, duty] = ["A, linear current", "A, linear duty"].map(|v| number("step", v, "settling_s"));
    // The band is 2 % of the step.
    assert!(linear <= 0.43, "{linear} s");
    assert!((1.5..3.0).contains(&duty), "{duty} s");
    let [linear, duty] = ["A, linear current", "A, linear duty"].map(|v| number("step", v, "absolute_error"));
    assert!(linear < 0.6 * duty, "{linear} against {duty} counts");
}

#[test]
fn an_overhauling_load_is_held_still_with_a_braking_regime_only() {
    let [none, a, b] = ["none", "A, linear current", "B, linear current"]
        .map(|variant| number("overhauling", variant, "limit_cycle"));
    assert!(none > 200.0, "forward and reverse alone swing by {none} counts/s");
    assert!(a < 20.0 && b < 20.0, "{a} and {b} counts/s");
    let returned = number("overhauling", "A, linear current", "energy_returned_j");
    assert!(returned > 5.0, "{returned} J");
}

#[test]
fn the_document_ranks_every_variant_and_names_its_charts() {
    let scores = QUICK["scores"].as_array().unwrap();
    assert_eq!(scores.len(), 12);
    let ratio = |score: &Value| score["error_ratio"].as_f64().unwrap();
    assert!(scores.windows(2).all(|pair| ratio(&pair[0]) <= ratio(&pair[1])));
    assert!(scores.iter().all(|score| ratio(score) >= 1.0));
    assert!(scores[0]["variant"].as_str().unwrap().ends_with(", model"), "{}", scores[0]["variant"]);
    let winners = QUICK["rounds"][0]["winners"].as_array().unwrap();
    assert_eq!(winners.len(), 3 * 6);
    let files = QUICK["files"].as_array().unwrap();
    assert_eq!(files.len(), 3 + 1, "a chart of each task, and the tables");
    let tables = files.iter().filter_map(Value::as_str).find(|file| file.ends_with("tables.md")).unwrap();
    let tables = std::fs::read_to_string(tables).unwrap();
    assert!(tables.lines().filter(|line| line.starts_with('|')).count() > 20, "{tables}");
    assert!(files.iter().all(|file| Path::new(file.as_str().unwrap()).is_file()));
}
