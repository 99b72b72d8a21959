//! What a scenario's battery and a hub that is told wrong do to a run.
#![expect(clippy::unwrap_used, reason = "a failed access is a failed test")]

use simulated::scenario::Scenario;
use simulated::sim;

const SCENARIO: &str = r#"name = "a battery that runs down"
duration_s = 3.0
battery = { emf_v = 13.0, resistance_ohm = 0.6, emf_over_time = [{ at_s = 1.0, emf_v = 13.0 }, { at_s = 2.0, emf_v = 8.0 }] }

[[motors]]
label = "told right"
motor = "AM 60 A"
setpoints = [{ at_s = 0.0, velocity_cps = 1000 }]

[[motors]]
label = "told wrong"
motor = "AM 60 A"
told = { resistance = 1.3, emf = 0.5 }
setpoints = [{ at_s = 0.0, velocity_cps = 1000 }]
"#;

// One test: the mock clock is one for the whole process.
#[test]
fn the_battery_follows_its_course_and_the_hub_believes_what_it_is_told() {
    let scenario = Scenario::parse("s.toml", SCENARIO).unwrap();
    let [right, wrong] = [0, 1].map(|n| scenario.motors.get(n).unwrap().settings().unwrap());
    assert!((2 * wrong.winding.emf.to_bits() - right.winding.emf.to_bits()).abs() <= 1);
    assert_ne!(wrong.winding.resistance.as_milliohms(), right.winding.resistance.as_milliohms());

    let trace = sim::run(&scenario, &mut |_| ()).unwrap();
    let voltage = |at_s: f64| trace.ticks.iter().find(|tick| tick.at_s >= at_s).unwrap().battery_v;
    // Two idling motors draw about a quarter of an ampere.
    for (at_s, emf) in [(0.9, 13.0), (1.5, 10.5), (2.5, 8.0)] {
        assert!((emf - 0.6..emf).contains(&voltage(at_s)), "{} V at {at_s} s", voltage(at_s));
    }
    let (_, last) = trace.motor(0).last().unwrap();
    assert!((last.speed_cps - 1000.0).abs() < 20.0, "{} counts/s", last.speed_cps);
}
