//! Coefficients that hosts usually set, on the served motors. The motors run at half of their free speed and to a
//! position, at every control period, in every scheme, with both duty rules.

use motor_hub::braking::{DutyRule, Scheme};
use motor_hub::motion::Pidf;
use motor_hub::motor::Setpoint;
use motor_hub::units::{Coefficient, Control, CountsPerSecond, Period};
use simulated::scenario::{Motor, Scenario, Timed};
use simulated::without_tasks;
use std::thread;

const PERIODS_MS: [u32; 4] = [1, 10, 50, 100];

fn pidf(values: [f64; 4]) -> Pidf {
    let [p, i, d, f] = values.map(|value| Coefficient::from_bits((65_536.0 * value).round() as i32));
    Pidf { p, i, d, f }
}

fn free_speed(motor: &Motor) -> f64 {
    12_000.0 / motor.constants.ke_fw()
}

/// The served motors, with a set-point from the first tick on.
fn served(scheme: Scheme, duty: DutyRule, period_ms: u32, setpoint: impl Fn(&Motor) -> Setpoint) -> Scenario {
    let mut scenario = Scenario::to_serve();
    scenario.period = Period::from_millis(period_ms).expect("in range");
    scenario.duration_s = 6.0;
    for motor in &mut scenario.motors {
        (motor.scheme, motor.duty) = (scheme, duty);
        motor.setpoints = vec![Timed { at_s: 0.0, value: setpoint(motor) }];
    }
    scenario
}

/// Returns the mean speed of each motor in the last half second, and its largest distance from `position`.
fn outcome(scenario: &Scenario, position: i64) -> Vec<(f64, i64)> {
    let from = (1e3 * scenario.duration_s) as u64 - 500;
    let mut sums = vec![(0.0, 0); scenario.motors.len()];
    without_tasks::run(scenario, |moment| {
        if moment.ms >= from {
            for (sum, &(speed, counts)) in sums.iter_mut().zip(&moment.view.motors) {
                *sum = (sum.0 + speed / 500.0, sum.1.max((counts - position).abs()));
            }
        }
    })
    .expect("it runs");
    sums
}

/// Coefficients of a velocity loop for a motor with this speed at full power, in counts/s.
type Velocity = fn(f64) -> [f64; 4];

const LEGACY: Velocity = |_| [10.0, 3.0, 0.0, 0.0];
/// F gives full control at the speed at full power. P is a tenth of F, and I is a tenth of P.
const COMMUNITY: Velocity = |fastest| {
    let f = f64::from(Control::MAX.get()) / fastest;
    [f / 10.0, f / 100.0, 0.0, f]
};
const FED_FORWARD: Velocity = |_| [2.0, 0.5, 0.0, 11.1];

/// The served motors' speeds at full power.
fn fastest() -> Vec<f64> {
    let full = served(Scheme::A, DutyRule::LinearCurrent, 50, |_| Setpoint::ConstantPower(Control::MAX));
    outcome(&full, 0).into_iter().map(|(speed, _)| speed).collect()
}

/// Final error of each motor's speed in percent of half of its free speed.
fn misses(mut scenario: Scenario, set: impl Fn(f64) -> [f64; 4], fastest: &[f64]) -> Vec<f64> {
    for (motor, &fastest) in scenario.motors.iter_mut().zip(fastest) {
        motor.velocity = Some(pidf(set(fastest)));
    }
    let speeds = outcome(&scenario, 0);
    let miss = |(motor, (speed, _))| 100.0 * (speed / half(motor) - 1.0);
    scenario.motors.iter().zip(speeds).map(miss).collect()
}

fn half(motor: &Motor) -> f64 {
    (free_speed(motor) / 2.0).round()
}

fn at_half(scheme: Scheme, duty: DutyRule, period_ms: u32) -> Scenario {
    served(scheme, duty, period_ms, |motor| Setpoint::Velocity(CountsPerSecond::new(half(motor) as i32)))
}

/// A scheme, a duty rule and a period, with the error of each motor.
type Line = ((Scheme, DutyRule, u32), Vec<f64>);

/// All schemes, duty rules and periods, a line each.
fn all(run: impl Fn(Scheme, DutyRule, u32) -> Vec<f64> + Sync) -> Vec<Line> {
    let rules = Scheme::ALL.iter().flat_map(|&scheme| DutyRule::ALL.map(|duty| (scheme, duty)));
    let cells: Vec<_> = rules.flat_map(|(scheme, duty)| PERIODS_MS.map(|ms| (scheme, duty, ms))).collect();
    let line = |&(scheme, duty, ms): &(Scheme, DutyRule, u32)| ((scheme, duty, ms), run(scheme, duty, ms));
    let (some, others) = cells.split_at(cells.len() / 2);
    thread::scope(|scope| {
        let others = scope.spawn(|| others.iter().map(line).collect::<Vec<_>>());
        let mut lines: Vec<_> = some.iter().map(line).collect();
        lines.extend(others.join().expect("it runs"));
        lines
    })
}

/// Runs a set of coefficients in all cases; the speed must settle within 2 %.
fn settles(name: &str, set: Velocity) {
    let fastest = fastest();
    let lines = all(|scheme, duty, ms| misses(at_half(scheme, duty, ms), set, &fastest));
    for (cell, misses) in &lines {
        for (motor, miss) in misses.iter().enumerate() {
            assert!(miss.abs() < 2.0, "{name}: motor {motor} misses by {miss:.1} %: {cell:?}");
        }
    }
}

#[test]
#[ignore = "long: cargo xtask long"]
fn legacy_coefficients_settle_at_every_period_and_in_every_scheme() {
    settles("P 10, I 3", LEGACY);
}

#[test]
fn coefficients_by_the_community_rule_settle_at_every_period_and_in_every_scheme() {
    settles("F 32767 / fastest, P F / 10, I P / 10", COMMUNITY);
}

#[test]
fn coefficients_with_feed_forward_settle_at_every_period_and_in_every_scheme() {
    settles("P 2, I 0.5, F 11.1", FED_FORWARD);
}

/// The motor is the fan of the default scenario. Relative to the full control value per full speed, P is 0.042 and I is
/// 0.0106 per cycle of 50 ms. F gives only a quarter of the control value. The rest of the error decays with a time
/// constant of 1.042 / 0.0106 cycles, or 4.9 s. The time constant is the same without a load.
#[test]
#[ignore = "long: cargo xtask long"]
fn coefficients_that_are_small_for_a_motor_take_the_time_that_they_stand_for() {
    let slow = Scenario::default_one().expect("it is valid").motors.pop().expect("four motors");
    let at_half_speed = Setpoint::Velocity(CountsPerSecond::new(half(&slow) as i32));
    for (ms, share) in PERIODS_MS.map(|ms| (ms, 1.0)).into_iter().chain([(50, 0.0)]) {
        let miss = |seconds: f64| {
            let mut scenario = at_half(Scheme::A, DutyRule::LinearCurrent, ms);
            scenario.duration_s = seconds;
            let fan = scenario.motors.last_mut().expect("four motors");
            *fan = Motor { setpoints: vec![Timed { at_s: 0.0, value: at_half_speed }], ..slow.clone() };
            fan.load.inertia_after.0 *= share;
            *misses(scenario, FED_FORWARD, &[0.0; 4]).last().expect("four motors")
        };
        let left = miss(11.0) / miss(6.0);
        assert!((left - (-5.0f64 / 4.9).exp()).abs() < 0.05, "{left} is left after 5 s at {ms} ms");
        assert!(miss(20.0).abs() < 2.0, "{} at {ms} ms", miss(20.0));
    }
}

/// A motor that friction holds breaks away, moves, and is held again. A scheme without a braking regime opens the bridge
/// where others brake, so the motor coasts. At 100 ms three of twelve motors then pass the tolerance by up to 2 counts,
/// for 3 to 8 % of the time.
#[test]
#[ignore = "long: cargo xtask long"]
fn positions_are_reached_and_held_by_what_hosts_set() {
    const TARGET: i64 = 2_000;
    const TOLERANCE: u16 = 5;
    const WITHOUT_BRAKING: (Scheme, DutyRule, u32) = (Scheme::ForwardReverse, DutyRule::LinearCurrent, 100);
    for set in [[5.0, 0.0, 0.0, 0.0], [10.0, 0.0, 0.0, 0.0], [10.0, 0.05, 0.0, 0.0]] {
        let lines = all(|scheme, duty, period| {
            let speed_limit = CountsPerSecond::new(32_767);
            let setpoint = Setpoint::Position { target: TARGET as i32, tolerance: TOLERANCE, speed_limit };
            let mut scenario = served(scheme, duty, period, |_| setpoint);
            for motor in &mut scenario.motors {
                motor.position = Some(pidf(set));
            }
            outcome(&scenario, TARGET).into_iter().map(|(_, off)| off as f64).collect()
        });
        for (cell, off) in &lines {
            let beyond = if *cell == WITHOUT_BRAKING { 2.0 } else { 0.0 };
            assert!(
                off.iter().all(|&off| off <= f64::from(TOLERANCE) + beyond),
                "{set:?}: {off:?}, {cell:?}"
            );
        }
    }
}
