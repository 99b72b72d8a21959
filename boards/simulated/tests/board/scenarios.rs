//! What scenarios hold, and what holds when.

use motor_hub::model::si;
use simulated::scenario::{Scenario, Timed};

#[test]
fn the_shipped_scenarios_are_valid() {
    assert!(Scenario::default_one().is_ok());
    for entry in std::fs::read_dir("scenarios").expect("the folder exists") {
        let path = entry.expect("it can be listed").path();
        assert!(Scenario::load(&path).is_ok(), "{:?}", Scenario::load(&path).err());
    }
}

#[test]
fn a_battery_runs_down_in_straight_lines() {
    let mut scenario = Scenario::default_one().expect("it is valid");
    assert_eq!(scenario.emf_at(7.0), scenario.battery.emf);
    scenario.battery.emf = si::Volts(13.0);
    scenario.emf_over_time = vec![Timed { at_s: 2.0, value: 13.0 }, Timed { at_s: 4.0, value: 8.0 }];
    assert_eq!([0.0, 2.0, 3.0, 4.0, 9.0].map(|at| scenario.emf_at(at).0), [13.0, 13.0, 10.5, 8.0, 8.0]);
}

#[test]
fn a_value_holds_until_the_next() {
    let mut motor = Scenario::default_one().expect("it is valid").motors.remove(0);
    motor.torques = vec![Timed { at_s: 1.0, value: 7.0 }, Timed { at_s: 2.0, value: 8.0 }];
    assert_eq!([0.9, 1.0, 5.0].map(|at| motor.torque_at(at)), [0.0, 7.0, 8.0]);
}
