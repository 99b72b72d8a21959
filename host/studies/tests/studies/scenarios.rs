//! Runs every scenario in `tests/scenarios` on the simulated board, and checks its expectations.

use crate::{run, scenario_files};
use simulated::scenario::Scenario;
use studies::expectations::{Verdict, judge};

fn verdicts(scenario: &Scenario) -> Vec<Verdict> {
    judge(scenario, &run(scenario))
}

#[test]
fn every_scenario_is_as_it_expects() {
    let mut unmet = Vec::new();
    for (file, scenario) in scenario_files::all() {
        assert!(!scenario.expectations.is_empty(), "{file} expects nothing");
        unmet.extend(scenario_files::unmet(&file, &verdicts(&scenario)));
    }
    assert!(unmet.is_empty(), "not as expected:\n{}", unmet.join("\n"));
}

/// Runs a scenario with one expectation. Returns the verdict on the expectation.
fn verdict(text: &str) -> Verdict {
    verdicts(&Scenario::parse("one.toml", text).expect("it is valid")).pop().expect("one expectation")
}

/// A motor that reaches two speeds and is then pushed, with one expectation.
fn with(expectation: &str) -> Verdict {
    verdict(&format!(
        r#"
name = "a motor turns"
duration_s = 3.0
battery = {{ emf_v = 12.0, resistance_ohm = 0.05 }}
[[motors]]
label = "one"
motor = "AM 60 A"
load = {{ inertia_kg_m2 = 0.01 }}
setpoints = [{{ at_s = 0.2, velocity_cps = 2000 }}, {{ at_s = 1.5, velocity_cps = 500 }}]
torques = [{{ at_s = 2.2, torque_nm = 0.2 }}]
[[expect]]
{expectation}
"#
    ))
}

#[test]
fn every_expectation_can_hold_and_can_fail() {
    for (holds, fails) in [
        ("to_s = 1.5\nsettles_within_s = 1.3", "settles_within_s = 0.01"),
        ("overshoot_below_percent = 50", "overshoot_below_percent = 0"),
        ("speed_between_cps = [-100, 2500]", "speed_between_cps = [-100, 1500]"),
        ("speed_between_cps = [-100, 2500]", "speed_between_cps = [500, 2500]"),
        ("from_s = 2.9\nspeed_between_cps = [480, 520]", "to_s = 1.0\nspeed_between_cps = [480, 520]"),
        ("position_between_counts = [0, 5000]", "position_between_counts = [0, 1000]"),
        ("from_s = 2.9\nswing_between_cps = [0, 100]", "swing_between_cps = [0, 100]"),
        ("swing_between_cps = [1500, 2500]", "swing_between_cps = [3000, 4000]"),
        ("current_step_below_a = 100", "current_step_below_a = 0.01"),
        ("energy_returned_between_j = [0.1, 20]", "energy_returned_between_j = [20, 30]"),
        ("bus_between_v = [9, 13]", "bus_between_v = [9, 11.9]"),
        ("ever = [\"braking\"]", "to_s = 0.9\never = [\"reverse\"]"),
        ("to_s = 0.2\nnever = [\"forward\"]", "never = [\"forward\"]"),
        ("from_s = 0.3\nnever = [\"coast\"]", "never = [\"coast\"]"),
        ("fault = \"none\"", "fault = \"reversed\""),
    ] {
        let verdict = with(holds);
        assert!(verdict.met(), "{holds}: {verdict}");
        let verdict = with(fails);
        assert!(!verdict.met(), "{fails}: {verdict}");
        assert_eq!(scenario_files::unmet("one.toml", &[verdict]).len(), 1);
    }
}

#[test]
fn an_expectation_that_measures_nothing_is_not_met() {
    // In each of these windows there is nothing to measure: no change begins, there is no control tick, or no motor
    // slows down.
    for nothing in [
        "from_s = 2.3\nsettles_within_s = 10",
        "from_s = 2.3\novershoot_below_percent = 100",
        "from_s = 1.01\nto_s = 1.02\nspeed_between_cps = [-9999, 9999]",
        "from_s = 1.01\nto_s = 1.02\nnever = [\"reverse\"]",
        "from_s = 1.01\nto_s = 1.02\nfault = \"none\"",
        "from_s = 1.01\nto_s = 1.02\nbus_between_v = [0, 20]",
        "to_s = 0.2\ncurrent_step_below_a = 100",
        // The torque changes 0.8 s before the end of the run.
        "from_s = 2.0\nsettles_within_s = 10",
        // The first speed has only 1 s, which is too short to settle and stay settled for 1 s.
        "to_s = 1.2\nsettles_within_s = 10",
    ] {
        let verdict = with(nothing);
        assert!(!verdict.met() && verdict.to_string().ends_with("measured nothing"), "{nothing}: {verdict}");
    }
}

#[test]
fn a_verdict_says_who_when_what_was_wanted_and_what_was() {
    let text = with("to_s = 0.5\nspeed_between_cps = [500, 600]").to_string();
    assert!(
        text.starts_with("one, 0 to 0.5 s: expected speed 500 to 600 counts/s, measured 0.00 to "),
        "{text}"
    );
    assert_eq!(with("fault = \"stuck\"").to_string(), "one, 0 to 3 s: expected fault: stuck, measured none");
}

/// Two wheels, of which the right one lags behind its reference, with one expectation. `right` has more keys of the
/// right wheel.
fn of_group(right: &str, expectation: &str) -> Verdict {
    verdict(&format!(
        r#"
name = "two wheels turn"
duration_s = 3.0
battery = {{ emf_v = 12.0, resistance_ohm = 0.05 }}
[[motors]]
label = "left"
motor = "AM 60 A"
[[motors]]
label = "right"
motor = "AM 60 A"
load = {{ drag_nms_per_rad = 0.05 }}
configured = {{ drag = 0.1 }}
{right}
[[groups]]
label = "base"
motors = ["left", "right"]
base = {{ wheel_diameter_mm = 90, track_mm = 300 }}
courses = [
    {{ at_s = 0.5, straight_mm = 100, speed_cps = 1500, acceleration_cps2 = 5000 }},
    {{ at_s = 2.0, on_cps = [100, 100], acceleration_cps2 = 5000 }},
]
[[expect]]
group = "base"
{expectation}
"#
    ))
}

#[test]
fn every_expectation_of_a_group_can_hold_can_fail_and_can_find_nothing() {
    for (wanted, met) in [
        ("to_s = 2.0\nsettles_within_s = 1.4", true),
        ("to_s = 2.0\nsettles_within_s = 0.5", false),
        // The motion never ends.
        ("from_s = 1.9\nsettles_within_s = 300", false),
        ("heading_error_below_degrees = 5", true),
        ("heading_error_below_degrees = 0.01", false),
    ] {
        let verdict = of_group("", wanted);
        assert_eq!(verdict.met(), met, "{wanted}: {verdict}");
    }
    // In these windows no course begins, or no wheel has a reference.
    for nothing in ["from_s = 2.5\nsettles_within_s = 300", "to_s = 0.4\nheading_error_below_degrees = 360"] {
        let verdict = of_group("", nothing);
        assert!(!verdict.met() && verdict.to_string().ends_with("measured nothing"), "{nothing}: {verdict}");
    }
}

#[test]
fn a_base_that_turns_after_it_lost_a_wheel_has_a_heading_error() {
    let expectation = "to_s = 2.0\nheading_error_below_degrees = 5";
    assert!(of_group("", expectation).met());
    // The encoder of the right wheel is unplugged in the middle of the course, while both wheels turn at full speed.
    let unplugged = "encoder = [{ at_s = 0.8, is = \"unplugged\" }]";
    let verdict = of_group(unplugged, expectation);
    assert!(!verdict.met(), "{verdict}");
    // The heading error is measured again for each course. The wheel with the encoder fault has no reference on the
    // next course.
    let verdict = of_group(unplugged, "from_s = 2.2\nheading_error_below_degrees = 360");
    assert!(verdict.to_string().ends_with("measured nothing"), "{verdict}");
}
