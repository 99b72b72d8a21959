//! The numbers of the README's comparisons are those that the program prints today.
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

/// In the order of the README's columns.
const VARIANTS: [&str; 8] = [
    "none",
    "A, linear duty",
    "B, linear duty",
    "A, linear current",
    "B, linear current",
    "none, model",
    "A, model",
    "B, model",
];

/// One line, nothing in bold.
fn plain(text: &str) -> String {
    text.replace("**", "").split_whitespace().collect::<Vec<_>>().join(" ")
}

fn assert_says(wanted: &[String]) {
    let readme = plain(README);
    let missing: Vec<&str> =
        wanted.iter().map(String::as_str).filter(|text| !readme.contains(&plain(text))).collect();
    assert!(missing.is_empty(), "README.md does not say:\n{}", missing.join("\n"));
}

fn json(arguments: &[&str], out: &str) -> Value {
    let out = folder(out);
    let output = motor_hub(&[arguments, &["--json", "--out", out.to_str().unwrap()]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("standard output is one JSON document")
}

fn list(value: &Value) -> &[Value] {
    value.as_array().expect("a list")
}

/// The one whose `key` is `name`.
fn named<'a>(of: &'a Value, key: &str, name: &str) -> &'a Value {
    list(of).iter().find(|entry| entry[key] == name).unwrap_or_else(|| panic!("no {name}"))
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn seconds(value: &Value) -> String {
    value.as_f64().map_or("never".to_owned(), |s| format!("{s:.2} s"))
}

fn row(heading: &str, cells: impl IntoIterator<Item = String>) -> String {
    cells.into_iter().fold(format!("| {heading} |"), |row, cell| format!("{row} {cell} |"))
}

#[test]
#[ignore = "long: cargo xtask long"]
fn the_readme_tells_of_the_winch_what_run_prints() {
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../boards/simulated/scenarios/winch.toml");
    let run = json(&["run", "--scenario", scenario.to_str().unwrap()], "readme-winch");
    let [braking, without] = ["as_set", "without_braking_regime"].map(|way| &run["motors"][0][way]);
    let [load, hunts] = [braking, without].map(|way| named(&way["responses"], "change", "torque to 0.8 N m"));
    let jerk = |way: &Value| format!("{:.2} A", number(&way["deceleration_jerk"]["rms_a"]));
    let energy = |way: &Value| format!("{:.1} J", number(&way["energy_to_battery_j"]));
    assert!(hunts["settling_s"].is_null());
    let hunting = format!("never: it hunts, {:.0} counts/s rms", number(&hunts["residual_rms"]));
    assert_says(&[
        row("back at its speed after", [seconds(&load["settling_s"]), hunting]),
        row("current jumps between periods while slowing down, rms", [braking, without].map(jerk)),
        row("energy back into the battery", [braking, without].map(energy)),
    ]);
}

#[test]
#[ignore = "long: cargo xtask long"]
fn the_readme_tells_of_the_variants_what_compare_prints() {
    let compare = json(&["compare"], "readme-compare");
    let [same, best] = [0, 1].map(|round| &compare["rounds"][round]);
    let settling = |round: &Value, task: &str| {
        let rows = &named(&round["tasks"], "key", task)["rows"];
        VARIANTS.map(|variant| seconds(&named(rows, "variant", variant)["settling_s"]))
    };
    // By task, who settles first, of those tasks at which somebody does.
    let first = |round: &Value| -> Vec<(String, Vec<String>)> {
        let names = |of: &Value| list(of).iter().map(|name| name.as_str().unwrap().to_owned()).collect();
        let settling = list(&round["winners"]).iter().filter(|winner| winner["column"] == "settling");
        let all =
            settling.map(|winner| (winner["task"].as_str().unwrap().to_owned(), names(&winner["variants"])));
        all.filter(|(_, variants): &(_, Vec<String>)| !variants.is_empty()).collect()
    };
    let wins = |round: &Value, variant: &str| -> Vec<(String, usize)> {
        let won = first(round).into_iter().filter(|(_, names)| names.iter().any(|name| name == variant));
        won.map(|(task, names)| (task, names.len())).collect()
    };
    let scores = list(&compare["scores"]);
    // Its own best coefficients are those of its row at the first task.
    let score = |variant: &str| {
        let gains = &named(&best["tasks"][0]["rows"], "variant", variant)["gains"];
        scores.iter().find(|score| score["variant"] == variant && &score["gains"] == gains).expect("scored")
    };
    let tasks = first(best).len();
    assert_eq!(tasks, first(same).len());
    let forward_reverse = wins(best, "none, model");
    let alone = forward_reverse.iter().filter(|(_, winners)| *winners == 1).count();
    let hunting =
        &named(&named(&best["tasks"], "key", "overhauling")["rows"], "variant", "none, model")["limit_cycle"];
    let counted = |round: &Value| VARIANTS.map(|variant| wins(round, variant).len().to_string());
    let jerk = |variant: &str| number(&score(variant)["mean_jerk_a"]);
    let gentle: Vec<f64> = ["C, linear duty", "C, linear current", "D, linear duty", "D, linear current"]
        .into_iter()
        .map(jerk)
        .collect();
    let (least, most) =
        (gentle.iter().copied().fold(f64::MAX, f64::min), gentle.iter().copied().fold(0.0, f64::max));
    assert_says(&[
        row("from 80 to 30 % of free speed, same coefficients (P 1.5 f, I 7.5 f/s)", settling(same, "step")),
        row("the same, own best coefficients", settling(best, "step")),
        row("a load drives it: back at its speed, same coefficients", settling(same, "overhauling")),
        row("the same, own best coefficients", settling(best, "overhauling")),
        row(
            &format!("settles first, alone or with others, of {tasks} tasks, same coefficients"),
            counted(same),
        ),
        row("settles first, own best coefficients", counted(best)),
        row(
            "speed error over all tasks, to the least of all, own best coefficients",
            VARIANTS.map(|variant| format!("{:.2}", number(&score(variant)["error_ratio"]))),
        ),
        row(
            "the same at its worst task",
            VARIANTS.map(|variant| format!("{:.1}", number(&score(variant)["worst_ratio"]))),
        ),
        format!("it hunts for ever where the load drives the motor, by {:.0} counts/s", number(hunting)),
        format!("settles first at {} of the {tasks} tasks, alone at {alone} of them", forward_reverse.len()),
        format!("with the others at {}", forward_reverse.len() - alone),
        format!(
            "Scheme A by PID settles first at {} of {tasks} tasks",
            wins(best, "A, linear current").len()
        ),
        format!(
            "worst current jumps of {:.1} A on average, against {least:.1} to {most:.1} A for C and D by PID",
            jerk("A, model")
        ),
    ]);
}

#[test]
#[ignore = "long: cargo xtask long"]
fn the_readme_tells_of_regulation_what_survey_prints() {
    let survey = json(&["survey", "--seed", "20261121"], "readme-survey");
    // At 50 ms, the fifth period of the six; by the model and by PID.
    let both = |task: &str| {
        let task = named(&survey["reference"], "name", task);
        ["model", "pid"].map(|kind| task[kind][4].clone())
    };
    let at_5_ms = |task: &str| {
        let task = named(&survey["reference"], "name", task);
        ["model", "pid"].map(|kind| task[kind][1].clone())
    };
    let settled = |verdict: Value| {
        format!("{}, {:.1} %", seconds(&verdict["settling_s"]), number(&verdict["beyond_percent"]))
    };
    let [out, back] = ["arm 0 -> 4000", "arm 4000 -> 500"]
        .map(|task| both(task).map(|verdict| seconds(&verdict["settling_s"])));
    let mut wanted = vec![
        row("flywheel, 80 to 30 % of free speed", both("flywheel 80 -> 30 %").map(settled)),
        row("winch, 0 to 1360 counts/s", both("winch 0 -> 1360").map(settled)),
        row("winch, 0.8 N m begin to drive it", both("winch +0.8 N m").map(settled)),
        row("the same at a control period of 5 ms", at_5_ms("winch +0.8 N m").map(settled)),
        row(
            "arm under gravity, 0 to 4000 counts and back to 500",
            out.iter().zip(&back).map(|(out, back)| format!("{out}, {back}")),
        ),
        row("0.5 kg m² moved by 5000 counts", both("0.5 kg m2 0 -> 5000").map(settled)),
    ];
    // What never settles of those told exactly, 0.7 J, 1.4 J, nothing.
    let never = |duty: &str| {
        let asked: Vec<&Value> =
            list(&survey["survey"]["responses"]).iter().filter(|response| response["duty"] == duty).collect();
        let shares = [0, 1, 2, 3].map(|told| {
            let never = asked.iter().filter(|response| response["verdicts"][told]["settling_s"].is_null());
            format!("{:.1} %", 100.0 * never.count() as f64 / asked.len() as f64)
        });
        (asked.len(), shares)
    };
    let (current, duty) = (never("linear-current"), never("linear-duty"));
    let cell = |told: usize| [current.1[told].clone(), duty.1[told].clone()];
    let wrong = [1, 2].map(cell);
    wanted.extend([
        format!("never settled | {} with linear current | {} with linear duty |", current.0, duty.0),
        row("model, told the motor as it is", cell(0)),
        row(
            "model, told 0.7 times its inertia; 1.4 times",
            [0, 1].map(|rule| format!("{}; {}", wrong[0][rule], wrong[1][rule])),
        ),
        row("PID, told nothing", cell(3)),
    ]);
    assert_says(&wanted);
}
