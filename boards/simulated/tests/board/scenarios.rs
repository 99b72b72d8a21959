//! Contents of scenarios, the values that are in force at a time, and runs with and without tasks.

use motor_hub::braking::Scheme;
use motor_hub::model::plant::Temperatures;
use motor_hub::model::train::Train;
use motor_hub::model::{catalogue, si};
use motor_hub::motor::{Setpoint, ThermalLimit};
use motor_hub::units::{Acceleration, Control, CountsPerSecond, Milliamperes, Period};
use simulated::scenario::{Group, Motor, Scenario, Timed};
use simulated::sim::RunError;
use simulated::without_tasks;
use std::num::NonZeroU16;

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
fn a_motor_becomes_warm_in_straight_lines_and_stays_so() {
    let mut motor = Scenario::default_one().expect("it is valid").motors.remove(0);
    assert_eq!(motor.temperatures_at(1.0), Temperatures::default());
    let hot = Temperatures { winding_k: 60.0, magnets_k: 50.0 };
    motor.heat = vec![Timed { at_s: 2.0, value: hot }];
    assert_eq!(motor.temperatures_at(1.0), Temperatures { winding_k: 30.0, magnets_k: 25.0 });
    assert_eq!([2.0, 9.0].map(|at_s| motor.temperatures_at(at_s)), [hot; 2]);
}

#[test]
fn a_value_holds_until_the_next() {
    let mut motor = Scenario::default_one().expect("it is valid").motors.remove(0);
    motor.torques = vec![Timed { at_s: 1.0, value: 7.0 }, Timed { at_s: 2.0, value: 8.0 }];
    assert_eq!([0.9, 1.0, 5.0].map(|at| motor.torque_at(at)), [0.0, 7.0, 8.0]);
}

#[test]
fn the_served_battery_motors_and_loads_are_those_of_the_default_scenario() {
    let (served, default) = (Scenario::to_serve(), Scenario::default_one().expect("it is valid"));
    assert_eq!((served.battery, served.period), (default.battery, default.period));
    assert_eq!(served.motors.len(), default.motors.len());
    for (served, default) in served.motors.into_iter().zip(default.motors) {
        let fan = catalogue::characterised("NeveRest 20").expect("it is in the catalogue");
        let same = match &*default.label {
            "fan" => default.with_constants(fan.with_measured_rotor_inertia()),
            _ => default,
        };
        let constants = catalogue::Motor { friction: served.constants.friction, ..same.constants };
        let (setpoints, torques) = (Vec::new(), Vec::new());
        assert_eq!(served, Motor { scheme: Scheme::A, constants, setpoints, torques, ..same });
    }
}

#[test]
fn currents_accelerations_and_trains_scale_with_another_motor() {
    let motor = Scenario::default_one().expect("it is valid").motors.remove(1);
    let other = catalogue::characterised("AM 3.7 B").expect("it is in the catalogue");
    let currents = motor.constants.r.0 / other.r.0;
    let [free, torque, angle] = [motor.constants, other]
        .map(|motor| {
            let free = motor.free_speed(si::Volts(12.0)).0;
            let torque = motor.stall_torque(si::Volts(12.0)).0 * motor.gear_ratio * motor.eta;
            [free * motor.counts_per_rev_motor, torque, free / motor.gear_ratio]
        })
        .into_iter()
        .reduce(|old, new| std::array::from_fn(|index| new[index] / old[index]))
        .expect("two");
    let current =
        Setpoint::Current { current: Milliamperes::new(2_000), speed_limit: CountsPerSecond::new(1_000) };
    let scaled = Motor {
        thermal: ThermalLimit::new(1_000, 20, 600).ok(),
        current_limit: NonZeroU16::new(3_000),
        acceleration: Acceleration::new(4_000).ok(),
        train: Some(Train { backlash_after: 0.02, stiffness_after: 300.0, damping_after: 0.3 }),
        setpoints: vec![Timed { at_s: 0.0, value: current }],
        ..motor
    }
    .with_constants(other);
    let close = |name: &str, got: f64, want: f64| {
        assert!((got / want - 1.0).abs() < 1e-3, "{name}: {got} instead of {want}");
    };
    close("thermal", scaled.thermal.expect("a limit").continuous_ma().into(), 1_000.0 * currents);
    close("current limit", scaled.current_limit.expect("a limit").get().into(), 3_000.0 * currents);
    close("acceleration", scaled.acceleration.expect("a limit").get().into(), 4_000.0 * free);
    let Setpoint::Current { current, .. } = scaled.setpoints[0].value else { panic!("a current") };
    close("current", current.get().into(), 2_000.0 * currents);
    let Train { backlash_after, stiffness_after, damping_after } = scaled.train.expect("a train");
    close("backlash", backlash_after, 0.02 * angle);
    close("stiffness", stiffness_after, 300.0 * torque / angle);
    close("damping", damping_after, 0.3 * torque / angle);
}

#[test]
fn motors_that_are_served_stop_as_soon_as_real_ones() {
    let mut scenario = Scenario::to_serve();
    scenario.duration_s = 6.0;
    let power = |share: f64| Setpoint::ConstantPower(Control::new((32_767.0 * share) as i16));
    for (release, within_s) in [(Setpoint::Disabled, 0.4..=1.6), (power(0.0), 0.0..=0.6)] {
        for motor in &mut scenario.motors {
            let on = Timed { at_s: 0.1, value: power(0.5) };
            motor.setpoints = vec![on, Timed { at_s: 3.0, value: release }];
        }
        let mut turned_at_s = [0.0; 4];
        without_tasks::run(&scenario, |moment| {
            for (at_s, (cps, _)) in turned_at_s.iter_mut().zip(&moment.view.motors) {
                if *cps != 0.0 {
                    *at_s = moment.ms as f64 / 1e3;
                }
            }
        })
        .expect("it runs");
        let took = turned_at_s.map(|at_s| at_s - 3.0);
        assert!(took.iter().all(|took| within_s.contains(took)), "{release:?}: {took:?} s");
    }
}

#[test]
fn a_scenario_for_a_host_needs_no_set_points() {
    let path = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("without-set-points.toml");
    let text = "name = \"n\"\nduration_s = 1\n[battery]\nemf_v = 12\nresistance_ohm = 0.1\n\
                [[motors]]\nlabel = \"one\"\nmotor = \"AM 60 A\"\n";
    std::fs::write(&path, text).expect("it can be written");
    assert!(Scenario::load(&path).is_err());
    let scenario = Scenario::load_for_a_host(&path).expect("it is valid");
    assert_eq!((scenario.motors.len(), scenario.commands().len()), (1, 0));
}

#[test]
fn a_run_without_tasks_is_the_run_with_them() {
    for period_ms in [1, 50] {
        let mut scenario = Scenario::default_one().expect("it is valid");
        scenario.duration_s = 2.0;
        scenario.period = Period::from_millis(period_ms).expect("in range");
        // The set-points of the motors are moved to different milliseconds. The tasks need more than a millisecond for
        // several commands of the same millisecond.
        for (index, motor) in scenario.motors.iter_mut().enumerate() {
            motor.setpoints.iter_mut().for_each(|setpoint| setpoint.at_s += 1e-3 * index as f64);
        }
        let trace = crate::run_tasks(&scenario);
        let mut ticks = trace.ticks.iter().peekable();
        without_tasks::run(&scenario, |moment| {
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
    assert_eq!(without_tasks::run(&scenario, |_| ()), Err(RunError::Gyro));
}
