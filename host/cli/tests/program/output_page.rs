//! The page docs/reference/output.md names every field of the JSON output, and no other field.

use crate::common::{self, fails, folder, motor_hub, out, store};
use crate::conformance::Hub;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

const PAGE: &str = include_str!("../../../../docs/reference/output.md");

/// Fields in the table of a section.
fn documented(section: &str) -> BTreeSet<String> {
    let heading = format!("\n## {section}\n");
    let from = PAGE.find(&heading).unwrap_or_else(|| panic!("docs/reference/output.md has no {section}"));
    let text = &PAGE[from + heading.len()..];
    let text = &text[..text.find("\n## ").unwrap_or(text.len())];
    let rows = text.lines().filter_map(|line| line.strip_prefix("| `"));
    rows.map(|row| row.split('`').next().unwrap().to_owned()).collect()
}

/// Paths of all fields of a document; a list of values is a field, and so is a null.
fn fields(value: &Value, path: &str, all: &mut BTreeSet<String>) {
    let inner = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
    match value {
        Value::Object(object) => object.iter().for_each(|(name, value)| fields(value, &inner(name), all)),
        Value::Array(list) => {
            all.extend(list.is_empty().then(|| format!("{path}[]")));
            list.iter().for_each(|value| fields(value, &format!("{path}[]"), all));
        }
        _ => drop(all.insert(path.to_owned())),
    }
}

fn assert_agree(section: &str, documents: &[Value]) {
    let mut said = BTreeSet::new();
    documents.iter().for_each(|document| fields(document, "", &mut said));
    assert!(documents.iter().all(|document| document["schema_version"] == 2), "{section}");
    let page = documented(section);
    let covers = |row: &str, field: &str| {
        row.strip_suffix(".*").map_or(row == field, |above| field.starts_with(&format!("{above}.")))
    };
    // A list that is empty here, or an object that is null, may have documented fields.
    let hollow = |field: &str| {
        let empty = field.trim_end_matches("[]");
        page.iter().any(|row| row.starts_with(&format!("{empty}.")) || row.starts_with(&format!("{empty}[")))
    };
    let unsaid: Vec<&String> =
        said.iter().filter(|field| !hollow(field) && !page.iter().any(|row| covers(row, field))).collect();
    assert!(unsaid.is_empty(), "docs/reference/output.md, {section}, lacks {unsaid:?}");
    let below = |row: &str| said.iter().any(|field| row.starts_with(field.trim_end_matches("[]")));
    let gone: Vec<&String> =
        page.iter().filter(|row| !below(row) && !said.iter().any(|field| covers(row, field))).collect();
    assert!(gone.is_empty(), "docs/reference/output.md, {section}, has {gone:?}, which nothing prints");
}

fn json(arguments: &[&str]) -> Value {
    common::json(&motor_hub(arguments))
}

#[test]
#[ignore = "long: cargo xtask long"]
fn studies_print_the_documented_fields() {
    let out = folder("page");
    let out = ["--json", "--out", out.to_str().unwrap()];
    let with = |arguments: &[&str]| json(&[arguments, &out].concat());
    let of_scenario = |file: &str| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/scenarios").join(file);
        with(&["run", "--scenario", path.to_str().unwrap()])
    };
    assert_agree(
        "run",
        &[with(&["run", "--time-s", "2"]), of_scenario("arm.toml"), of_scenario("drive-bases.toml")],
    );
    let survey = with(&["survey", "--only", "random", "--scenarios", "4"]);
    assert_eq!(documented("A verdict"), {
        let mut verdict = BTreeSet::new();
        fields(&survey["survey"]["responses"][0]["verdicts"][0], "", &mut verdict);
        verdict
    });
    assert_agree("survey", &[survey]);
    assert_agree("identify", &[with(&["identify"])]);
    assert_agree("soak", &[json(&["soak", "--hours", "0.01", "--json"])]);
    assert_agree("motors", &[json(&["motors", "--json"])]);
    assert_agree("paper", &[json(&["paper", "--json"])]);
    let at = ["--scheme", "D", "--motor", "AM 60 A", "--speed-cps", "9", "--battery-mv", "12000", "--json"];
    assert_agree("points", &[json(&[&["points"][..], &at].concat())]);
    assert_agree("map", &[json(&[&["map", "--control-steps", "7"][..], &at].concat())]);
    assert_agree("compare", &[with(&["compare", "--quick"])]);
}

#[test]
fn the_client_prints_the_documented_fields() {
    let served = Hub::served_with(&["--store", &store("page-client")]);
    let client = |arguments: &[&str]| {
        json(&[&["client", "--tcp", &served.place][..], arguments, &["--json"]].concat())
    };
    common::client(&served, &[&["drive", "turn=1"], &common::BASE[..]].concat());
    for (section, arguments) in [
        ("status", &["status"][..]),
        ("setup", &["setup", "0", "--scheme", "D", "--continuous-current-a", "1"]),
        ("settings show", &["settings", "show"]),
        ("coefficients", &["coefficients", "0", "velocity"]),
        ("identify", &["identify", "0"]),
        ("tune", &["tune", "1"]),
        ("discover", &["discover"]),
        ("scan", &["scan", "--only", "/no/such/port"]),
        ("servo", &["servo"]),
        ("analog", &["analog"]),
        ("digital", &["digital"]),
        ("i2c scan", &["i2c", "scan"]),
        ("i2c read", &["i2c", "read", "1", "0x50"]),
        ("odometry", &["odometry"]),
        ("ports", &["ports"]),
    ] {
        assert_agree(&format!("client {section}"), &[client(arguments)]);
    }
    let watch = ["client", "--tcp", &served.place, "watch", "--for-s", "0.2", "--type", "AM 60 A", "--json"];
    let lines = motor_hub(&watch).stdout;
    let line = lines.split(|byte| *byte == b'\n').next().unwrap();
    assert_agree("client watch", &[serde_json::from_slice(line).expect("a document a line")]);
}

#[test]
fn faults_are_printed_with_the_documented_fields() {
    // The encoder of its first motor falls silent after two seconds.
    let scenario = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/scenarios/broken-encoders.toml");
    let served =
        Hub::served_with(&["--store", &store("page-faults"), "--scenario", scenario.to_str().unwrap()]);
    let client = |arguments: &[&str]| common::client(&served, arguments);
    client(&["velocity", "0", "1000", "--for-s", "3.5"]);
    let document: Value = serde_json::from_slice(&client(&["faults", "--json"]).stdout).unwrap();
    assert_agree("client faults", std::slice::from_ref(&document));
    let entry = &document["entries"][0];
    assert_eq!((&entry["fault"], &entry["motor"], &entry["run"]), (&2.into(), &0.into(), &1.into()));
    let ticks = entry["ticks"].as_array().unwrap();
    assert!(ticks.len() > 20 && ticks[0]["velocity"] != ticks[ticks.len() - 1]["velocity"], "{ticks:?}");

    let words = |arguments: &[&str]| out(&client(arguments));
    assert!(words(&["faults"]).contains("2 no counts although driven"), "{}", words(&["faults"]));
    assert!(words(&["faults", "1"]).contains("last"), "{}", words(&["faults", "1"]));
    fails(&client(&["faults", "7"]), 1, "no ticks of entry 7; entries with ticks: 1");
    client(&["faults", "--clear"]);
    assert!(words(&["faults"]).contains("No faults or resets recorded"), "{}", words(&["faults"]));
}

#[test]
fn files_have_the_documented_columns() {
    let out = folder("page-csv");
    assert!(motor_hub(&["run", "--time-s", "0.2", "--out", out.to_str().unwrap()]).status.success());
    let trace = std::fs::read_to_string(out.join("trace.csv")).unwrap();
    for (file, headings) in [
        ("trace.csv", trace.lines().next().unwrap()),
        ("record.csv", studies::recording::HEADINGS.trim_end()),
    ] {
        let columns: BTreeSet<String> = headings.split(',').map(str::to_owned).collect();
        assert_eq!(documented(file), columns, "{file}");
    }
    let columns = trace.lines().next().unwrap().split(',').count();
    assert!(trace.lines().all(|row| row.split(',').count() == columns));
    let motors: BTreeSet<&str> = trace.lines().skip(1).map(|row| row.split(',').nth(1).unwrap()).collect();
    assert_eq!(motors.into_iter().collect::<String>(), "0123", "as the protocol numbers them");
    assert!(trace.lines().skip(1).all(|row| row.ends_with(",2")), "each row has the version of its schema");
}
