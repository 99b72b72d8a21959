//! A scenario has equal results with and without tasks.

use simulated::scenario::{Group, Scenario};
use simulated::sim::RunError;
use simulated::without_tasks::run;

#[test]
fn a_run_without_tasks_is_the_run_with_them() {
    for period_ms in [1, 50] {
        let mut scenario = Scenario::default_one().expect("it is valid");
        scenario.duration_s = 2.0;
        scenario.period = motor_hub::units::Period::from_millis(period_ms).expect("in range");
        // The set-points of the motors are moved to different milliseconds. The tasks need more than a millisecond for
        // several commands of the same millisecond.
        for (index, motor) in scenario.motors.iter_mut().enumerate() {
            motor.setpoints.iter_mut().for_each(|setpoint| setpoint.at_s += 1e-3 * index as f64);
        }
        let trace = crate::run_tasks(&scenario);
        let mut ticks = trace.ticks.iter().peekable();
        run(&scenario, |moment| {
            let at_s = moment.ms as f64 / 1e3;
            let Some(tick) = ticks.next_if(|tick| tick.at_s <= at_s) else { return };
            assert_eq!((tick.at_s, tick.battery_v), (at_s, moment.view.battery_v));
            for ((sample, &(speed, counts)), report) in
                tick.motors.iter().zip(&moment.view.motors).zip(&moment.snapshot.motors)
            {
                assert_eq!((sample.speed_cps, sample.counts), (speed, counts), "at {at_s} s");
                assert_eq!(&sample.report, report, "at {at_s} s");
            }
        })
        .expect("it runs");
        assert!(ticks.next().is_none());
    }
}

#[test]
fn a_run_without_tasks_refuses_a_scenario_whose_base_uses_the_gyro() {
    let mut scenario = Scenario::default_one().expect("it is valid");
    let group =
        Group { label: "base".into(), motors: vec![0, 1], base: None, use_gyro: true, courses: vec![] };
    scenario.groups.push(group);
    assert_eq!(run(&scenario, |_| ()), Err(RunError::Gyro));
}
