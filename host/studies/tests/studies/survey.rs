//! Tests the limits of regulation on a part of the survey that is short enough for a test.

use crate::{REFERENCE, clock};
use motor_hub::braking::DutyRule;
use studies::survey::soak::{self, Soak};
use studies::survey::{Knowledge, Response, Survey, Verdict, bare_motors, random, reference, sweep};

fn never(responses: &[&Response], knowledge: usize) -> f64 {
    let never = responses.iter().filter(|response| response.verdicts[knowledge].settling_s.is_none()).count();
    100.0 * never as f64 / responses.len() as f64
}

#[test]
fn what_can_be_settled_is_settled_by_a_configured_motor() {
    let survey = Survey::new(7, 40, &mut |_, _| ()).expect("it runs");
    // Responses with linear duty are not judged here, because this rule makes neither voltage nor current linear.
    let responses: Vec<&Response> =
        survey.responses.iter().filter(|response| response.duty == DutyRule::LinearCurrent).collect();
    assert!(responses.len() > 100, "{} of {}", responses.len(), survey.total_responses);
    let [exact, lighter, heavier] = [0, 1, 2].map(|knowledge| never(&responses, knowledge));
    // With 0.7 times the inertia 3 of 126 responses never settle. Without the detector of hunting the number is 2. With
    // 1.4 times the inertia no response fails to settle. Without the detector the number is 1.
    assert!(exact <= 1.0 && lighter <= 2.4 && heavier <= 2.0, "never settled: {exact} {lighter} {heavier} %");
    let exact = |response: &&Response| response.verdicts[0];
    let verdicts: Vec<Verdict> = responses.iter().map(exact).collect();
    assert!(!verdicts.iter().any(|verdict| verdict.cycles || verdict.fault));
    let steps = responses.iter().filter(|response| response.kind != studies::survey::Kind::Load);
    let mut beyond: Vec<f64> = steps.filter_map(|response| exact(response).beyond_percent).collect();
    beyond.sort_by(f64::total_cmp);
    assert!(beyond[beyond.len() * 9 / 10] <= 3.0, "{beyond:?}");
}

#[test]
fn the_tasks_of_the_reference_are_done_as_well_as_there() {
    let rows = &*REFERENCE;
    let fifty = reference::PERIODS.iter().position(|&ms| ms == 50).expect("one of them");
    let verdict = |name: &str| {
        let row = rows.iter().find(|row| row.name == name).expect("a task");
        (row.configured[fifty], row.speed)
    };
    for (name, settling, beyond) in [
        ("flywheel 0 -> 2330", 0.385, 1.0),
        ("flywheel 80 -> 30 %", 0.22, 1.0),
        ("winch 0 -> 1360", 0.30, 1.0),
        ("winch +0.8 N m", 0.25, 11.0),
        ("winch 2176 -> 816", 0.22, 1.0),
        ("winch 1632 -> -1632", 0.48, 1.0),
        ("arm 0 -> 4000", 2.55, 1.0),
        ("arm 4000 -> 500", 2.25, 1.0),
        ("0.5 kg m2 0 -> 5000", 4.5, 1.0),
        ("Matrix 12 V bare 0 -> 3000", 1.5, 1.0),
    ] {
        let (verdict, _) = verdict(name);
        assert!(verdict.settling_s.is_some_and(|s| s <= settling), "{name}: {verdict:?}");
        assert!(verdict.beyond_percent.is_some_and(|percent| percent <= beyond), "{name}: {verdict:?}");
    }
    assert!(verdict("arm 4000 -> 500, last error").0.last_error.abs() <= 1.0);
    assert!(verdict("winch 0, +0.4 N m: offset").0.last_error.abs() <= 2.0);
    // A change just after a tick waits for the next tick.
    let late = |row: &reference::Row| row.configured_late.get(fifty).and_then(|verdict| verdict.settling_s);
    let row = rows.iter().find(|row| row.name == "flywheel 80 -> 30 %").expect("a task");
    let waited = late(row).expect("it settles") - row.configured[fifty].settling_s.expect("it settles");
    assert!((0.04..=0.06).contains(&waited), "{waited} s later");
    let turn = rows.iter().find(|row| row.name.contains("turns of 90 degrees")).expect("a task");
    assert!(turn.configured_degrees[fifty] <= 0.15, "{turn:?}");
    for name in ["5 counts/s, rms", "10 counts/s, rms", "20 counts/s, rms", "50 counts/s, rms"] {
        let (verdict, speed) = verdict(name);
        assert!(verdict.last_rms <= 0.022 * speed, "{name}: {verdict:?}");
    }
}

#[test]
#[ignore = "long: cargo xtask long"]
fn every_bare_motor_settles_at_every_period() {
    let cells = bare_motors::run(&mut |_, _| ()).expect("it runs");
    let settled = |verdicts: &[Verdict; 2]| verdicts.iter().all(|verdict| verdict.settling_s.is_some());
    let failed: Vec<String> = cells
        .iter()
        .filter(|cell| !cell.paper_inertia)
        .flat_map(|cell| {
            bare_motors::PERIODS.iter().zip(&cell.configured).map(move |(ms, verdicts)| (cell, ms, verdicts))
        })
        .filter(|(_, _, verdicts)| !settled(verdicts))
        .map(|(cell, ms, verdicts)| format!("{} {} {ms} ms: {verdicts:?}", cell.motor, cell.mode))
        .collect();
    assert!(failed.is_empty(), "{} cells:\n{}", failed.len(), failed.join("\n"));
}

#[test]
fn a_drawn_scenario_is_its_own_file_again() {
    for number in 0..50 {
        let scenario = random::scenario(3, number);
        let text = random::toml(&scenario);
        let read = simulated::scenario::Scenario::parse("survey", &text);
        assert_eq!(read.as_ref().map_err(ToString::to_string), Ok(&scenario), "{text}");
    }
}

#[test]
#[ignore = "long: cargo xtask long"]
fn no_sound_encoder_is_doubted_and_no_watchdog_starves() {
    let _clock = clock();
    // This is a part of the scenarios that `motor-hub soak --hours 10` runs.
    let soak = Soak::new(2, 180.0, &mut |_| ()).expect("it runs");
    assert!(soak.is_clean(), "{}", soak::text(&soak));
    // 180 s have at least 1800 ticks, because the longest period is 100 ms.
    assert!(soak.ticks > 1_800, "{soak:?}");
}

#[test]
fn an_unknown_motor_with_heavy_friction_that_brakes_or_starts_and_stops_has_a_sound_encoder() {
    // Scenario 1113 of the sweep has an unknown motor that brakes from an estimated speed that it no longer has. In scenario
    // 2345 the friction of unknown motors is nearly the torque at full voltage, so they start and stop. A sweep of every
    // nth scenario contains scenario n.
    for every in [1113, 2345] {
        let soak = Soak::sweep(&sweep::scenarios(every), &mut |_, _| ()).expect("it runs");
        assert!(soak.is_clean(), "{}", soak::text(&soak));
    }
}

#[test]
#[ignore = "long: cargo xtask long"]
fn no_motor_s_sound_encoder_is_doubted_however_it_is_regulated() {
    // This is every seventh scenario of `motor-hub soak --sweep`.
    let soak = Soak::sweep(&sweep::scenarios(7), &mut |_, _| ()).expect("it runs");
    assert!(soak.is_clean(), "{}", soak::text(&soak));
    assert!(soak.motors > 4_000, "{soak:?}");
}

#[test]
#[ignore = "long: cargo xtask long"]
fn no_heavy_motor_s_sound_encoder_is_doubted_within_minutes() {
    // This is every 61st scenario of `motor-hub soak --sweep --long`. 61 is prime, so all periods, inertias and
    // configurations occur.
    let soak = Soak::sweep(&sweep::long_scenarios(61), &mut |_, _| ()).expect("it runs");
    // For unknown motors with large inertias the hub is known to report false alarms, so alarms of unknown motors are
    // not counted.
    let configured = |alarm: &&soak::Alarm| alarm.knowledge != Knowledge::UNKNOWN;
    assert!(!soak.alarms.iter().any(|alarm| configured(&alarm)), "{}", soak::text(&soak));
    assert!(soak.seconds > 3_600.0, "{soak:?}");
}
