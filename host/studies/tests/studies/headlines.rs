//! Tests the texts that users read first: the sentence with the result of a run, a comparison or a survey, and the
//! tables below it.

use crate::{COMPARISON, REFERENCE, report};
use motor_hub::model::load::Load;
use motor_hub::units::Period;
use simulated::scenario::Scenario;
use studies::report::RunReport;
use studies::survey::{Results, Survey};

fn with(motor: &str) -> Scenario {
    let text = format!(
        "name = \"one\"\nduration_s = 3.0\nbattery = {{ emf_v = 12.6, resistance_ohm = 0.05 }}\n\
         [[motors]]\nlabel = \"winch\"\nmotor = \"NeveRest 60\"\nload = {{ inertia_kg_m2 = 0.05 }}\n{motor}\n"
    );
    Scenario::parse("one.toml", &text).expect("it is valid")
}

/// Asserts that the text has no internal words, no infinite numbers, and no table that is wider than a page of
/// Markdown.
fn assert_readable(text: &str) {
    for word in ["inf s", "NaN", "told", "by lot", "| none"] {
        assert!(!text.contains(word), "{word}: {text}");
    }
    let rows = text.lines().filter(|line| line.starts_with("| "));
    rows.for_each(|row| assert!(row.matches(" | ").count() < 9, "{row}"));
}

#[test]
fn a_run_begins_with_where_braking_makes_the_largest_difference() {
    let held = "setpoints = [{ at_s = 0, velocity_cps = 1360 }]\ntorques = [{ at_s = 1.5, torque_nm = 0.8 }]";
    let report = report(with(held));
    let document = report.json(&[]);
    let settling =
        document["motors"][0]["as_set"]["responses"][1]["settling_s"].as_f64().expect("it settles");
    assert!(document["motors"][0]["without_braking_regime"]["responses"][1]["settling_s"].is_null());
    let headline = format!("winch held at its speed: {settling:.2} s with braking, never without.");
    assert_eq!(report.headline(), headline);
    let tables = report.tables();
    assert!(tables.starts_with(&headline) && tables.contains("winch: NeveRest 60"), "{tables}");
    assert_readable(&tables);
}

#[test]
fn a_run_of_several_motors_counts_what_settles() {
    let headline = report(Scenario::default_one().expect("it is valid")).headline();
    assert!(headline.contains(" responses settle with braking, "), "{headline}");
    assert!(headline.contains("; the largest difference: winch held at its speed, "), "{headline}");
}

#[test]
fn a_run_shows_when_a_group_has_settled_and_how_far_it_was_out_of_step() {
    let text = "name = \"two\"\nduration_s = 3.0\nbattery = { emf_v = 12.6, resistance_ohm = 0.05 }\n\
        [[motors]]\nlabel = \"free\"\nmotor = \"NeveRest 60\"\n\
        [[motors]]\nlabel = \"heavy\"\nmotor = \"NeveRest 60\"\nload = { inertia_kg_m2 = 0.05 }\n\
        [[groups]]\nlabel = \"pair\"\nmotors = [\"free\", \"heavy\"]\ncourses = [\n\
        { at_s = 0, to_counts = [800, -400], speed_cps = 1600, acceleration_cps2 = 4000 },\n\
        { at_s = 1.5, on_cps = [500, 500], acceleration_cps2 = 4000 },\n]\n";
    let report = report(Scenario::parse("two.toml", text).expect("it is valid"));
    let group = &report.json(&[])["groups"][0];
    assert_eq!((&group["label"], &group["as_set"]["heading_error_degrees"]), (&"pair".into(), &().into()));
    // The course at speeds does not end.
    let courses = group["as_set"]["courses"].as_array().expect("a list");
    assert_eq!(courses.len(), 1);
    let settling_s = courses[0]["settling_s"].as_f64().expect("it settles");
    // 800 counts at 1600 counts/s, and 0.4 s to accelerate and to stop.
    assert!((0.9..1.3).contains(&settling_s), "{settling_s} s");
    let out_of_step = group["as_set"]["out_of_step_counts"].as_f64().expect("a number");
    assert!((0.5..100.0).contains(&out_of_step), "{out_of_step} counts");
    let tables = report.tables();
    for words in
        ["pair: free, heavy in step", &format!("{settling_s:.2} s"), &format!("{out_of_step:.1} counts")]
    {
        assert!(tables.contains(words), "{words}: {tables}");
    }
    assert_readable(&tables);
}

#[test]
fn a_run_of_several_motors_without_a_difference_names_none() {
    let mut scenario = with("setpoints = [{ at_s = 0, velocity_cps = 500 }]");
    scenario.motors.push(scenario.motors[0].clone());
    scenario.motors.iter_mut().for_each(|motor| motor.load = Load::NONE);
    assert_eq!(report(scenario).headline(), "2 of 2 responses settle with braking, 2 without.");
}

/// A motor with constant power from the start, at a control period.
fn powered(period_ms: u32, duration_s: f64) -> Scenario {
    let scenario = with("setpoints = [{ at_s = 0, power = 0.5 }]");
    Scenario { duration_s, period: Period::from_millis(period_ms).expect("it is allowed"), ..scenario }
}

#[test]
fn energies_count_from_the_start_at_every_control_period() {
    let energy = |report: &RunReport| {
        let energy = report.json(&[])["motors"][0]["as_set"]["energy_from_battery_j"].as_f64();
        energy.expect("a number")
    };
    // The shorter runs end before the first tick, except at 1 ms.
    for duration_s in [0.05, 1.0] {
        let all = energy(&report(powered(1, duration_s)));
        assert!(all > 0.1, "{all} J");
        for ms in [50, 100] {
            let report = report(powered(ms, duration_s));
            let joules = energy(&report);
            assert!((joules / all - 1.0).abs() < 1e-3, "{duration_s} s at {ms} ms: {joules} J of {all} J");
            let [(_, csv), _] = report.traces();
            let column =
                csv.split(',').position(|heading| heading == "energy_from_battery_j").expect("it is there");
            let rows: Vec<f64> = csv
                .lines()
                .skip(1)
                .map(|row| row.split(',').nth(column).expect("a cell").parse().expect("a number"))
                .collect();
            let sum: f64 = rows.iter().sum();
            assert!(rows.is_empty() || (sum - joules).abs() < 1e-3, "{sum} J in {joules} J");
        }
    }
}

#[test]
fn a_run_without_a_control_tick_says_so_and_has_no_signed_zero() {
    let text =
        report(Scenario { duration_s: 0.05, ..with("setpoints = [{ at_s = 1, power = 0.5 }]") }).tables();
    assert!(text.starts_with("The battery gave 0.00 J and got back 0.00 J with braking;"), "{text}");
    assert!(text.contains("no control tick") && !text.contains("-0.00"), "{text}");
}

#[test]
fn a_one_way_battery_gets_nothing_back() {
    let scenario = "bus = { capacitance_f = 0.1, one_way = true }\n";
    let motor = "[[motors]]\nlabel = \"winch\"\nmotor = \"NeveRest 60\"\nload = { torque_nm = 0.8 }\n\
                 setpoints = [{ at_s = 0.2, current_a = -0.6 }]\n";
    let head = "name = \"one\"\nduration_s = 2.0\nbattery = { emf_v = 12.6, resistance_ohm = 0.05 }\n";
    let scenario = Scenario::parse("one.toml", &[head, scenario, motor].concat()).expect("it is valid");
    let headline = report(scenario).headline();
    assert!(headline.starts_with("The motors took "), "{headline}");
    assert!(headline.ends_with(" J. The one-way battery got nothing back."), "{headline}");
}

#[test]
fn a_run_without_regulation_tells_energies_and_a_run_with_expectations_whether_they_are_met() {
    let power = "setpoints = [{ at_s = 0, power = 0.5 }]\n[[expect]]\nnever = [\"reverse\"]";
    let headline = report(with(power)).headline();
    assert!(headline.starts_with("The battery gave "), "{headline}");
    assert!(headline.ends_with(" J. The expectation is met."), "{headline}");
    let unmet = report(with(&power.replace("reverse\"]", "forward\", \"reverse\"]"))).headline();
    assert!(unmet.ends_with(" 1 of 2 expectations are not met."), "{unmet}");
    let none = with("scheme = \"none\"\nsetpoints = [{ at_s = 0, velocity_cps = 500 }]");
    assert_eq!(report(none).headline(), "1 of 1 responses settle without a braking regime.");
}

#[test]
fn a_comparison_begins_with_the_winner_and_fits_a_page() {
    let best = COMPARISON.json(&[])["scores"][0]["variant"].as_str().expect("a name").to_owned();
    let text = COMPARISON.text();
    assert!(
        text.starts_with(&format!("{best} wins: it has the least error on average over 3 tasks")),
        "{text}"
    );
    let markdown = COMPARISON.markdown();
    assert_readable(&markdown);
    assert!(markdown.starts_with(&format!("{best} wins: ")) && markdown.contains("| never |"), "{markdown}");
}

#[test]
fn a_survey_begins_with_what_settles_and_fits_a_page() {
    let survey = Survey::new(1, 3, &mut |_, _| ()).expect("it runs");
    let all = survey.responses.len();
    let settled =
        survey.responses.iter().filter(|response| response.verdicts[0].settling_s.is_some()).count();
    let results = Results { survey: Some(survey), reference: Some(REFERENCE.clone()), cells: None };
    let page = results.page(2);
    assert!(page.terminal().starts_with("Configured exactly, the hub settles "), "{}", page.terminal());
    let markdown = page.markdown();
    assert!(
        markdown.contains(&format!("{settled} of {all} random responses (not configured: ")),
        "{markdown}"
    );
    assert_readable(&markdown);
}
