//! Counts that wrap, and the PID loop.

use motor_hub::motion::pid::{PidInput, Value};
use motor_hub::motion::{Pid, Pidf, Reading, Tracker};
use motor_hub::units::{Coefficient, Micros, Period};

const PERIOD: Period = Period::DEFAULT;

#[test]
fn positions_unwrap_in_both_directions() {
    let mut tracker = Tracker::default();
    let mut position = 0i32;
    tracker.step(0, Micros::new(0));
    for (n, step) in [30_000, 30_000, -32_768, 7, -30_000, -30_000, 32_767, 32_767, 1].into_iter().enumerate()
    {
        position += step;
        let reading = tracker.step(position as u16, Micros::new(n as u64 + 1));
        assert_eq!(reading.position, position);
    }
}

#[test]
fn an_edge_gets_the_time_of_the_sample_that_shows_it_and_keeps_this_time_while_nothing_moves() {
    let mut tracker = Tracker::default();
    assert_eq!(
        tracker.step(65_535, Micros::new(5)),
        Reading { position: 0, edge_at: Micros::new(5), at: Micros::new(5) }
    );
    assert_eq!(
        tracker.step(0, Micros::new(6)),
        Reading { position: 1, edge_at: Micros::new(6), at: Micros::new(6) }
    );
    assert_eq!(
        tracker.step(0, Micros::new(9)),
        Reading { position: 1, edge_at: Micros::new(6), at: Micros::new(9) }
    );
}

fn q16(value: f64) -> Coefficient {
    Coefficient::from_bits((value * 65_536.0).round() as i32)
}

const LIMIT: Value = Value::const_from_int(32_767);

fn value(whole: i32) -> Value {
    Value::from_num(whole)
}

fn input(error: i32, measured: i32) -> PidInput {
    PidInput { error: value(error), measured: value(measured), feed_forward: Value::ZERO, limit: LIMIT }
}

#[test]
fn each_coefficient_has_its_stated_unit() {
    let only_p = Pidf { p: q16(2.5), ..Pidf::default() };
    assert_eq!(Pid::default().step(&only_p, PERIOD, input(100, 0)), value(250));

    let only_f = Pidf { f: q16(3.0), ..Pidf::default() };
    let fed = PidInput { feed_forward: value(400), ..input(0, 0) };
    assert_eq!(Pid::default().step(&only_f, PERIOD, fed), value(1200));

    // An error of 100 for one second with I = 0.2 per cycle of 50 ms gives 400 at every period.
    let only_i = Pidf { i: q16(0.2), ..Pidf::default() };
    for ms in [1, 10, 50, 100] {
        let mut pid = Pid::default();
        let period = Period::from_millis(ms).expect("period");
        let output = (0..1_000 / ms).map(|_| pid.step(&only_i, period, input(100, 0))).last().expect("steps");
        assert!((output - value(400)).abs() <= Value::from_bits(8), "{output} at {ms} ms");
    }

    // An acceleration of 1000 counts/s² changes the speed by 50 counts/s per cycle of 50 ms. With D = 10 the output is
    // -500.
    let only_d = Pidf { d: q16(10.0), ..Pidf::default() };
    let mut pid = Pid::default();
    assert_eq!(pid.step(&only_d, PERIOD, input(0, 0)), Value::ZERO, "no kick at the start");
    // The filter of the D term has a time constant of 20 ms, so the first step gives 50/70 of the value.
    let output = pid.step(&only_d, PERIOD, input(0, 50)).to_num::<f64>();
    assert!((output + 500.0 * 50.0 / 70.0).abs() < 0.02, "{output}");
    let output = (2..20).map(|n| pid.step(&only_d, PERIOD, input(0, 50 * n))).last().expect("steps");
    assert!((output + value(500)).abs() < value(1), "{output}");
    for ms in [1, 10, 100] {
        let mut pid = Pid::default();
        let period = Period::from_millis(ms).expect("period");
        let step = |n| pid.step(&only_d, period, input(0, n * ms as i32));
        let output = (0..1_000 / ms as i32).map(step).last().expect("steps");
        assert!((output + value(500)).abs() < value(1), "{output} at {ms} ms");
    }
    let mut pid = Pid::default();
    pid.step(&only_d, PERIOD, input(0, 50));
    assert_eq!(pid.step(&only_d, PERIOD, input(9999, 50)), Value::ZERO, "no kick from a new set-point");
}

#[test]
fn the_integrator_does_not_wind_up_while_the_output_saturates() {
    let gains = Pidf { p: q16(10.0), i: q16(1.0), ..Pidf::default() };
    let mut wound = Pid::default();
    for _ in 0..1000 {
        assert_eq!(wound.step(&gains, PERIOD, input(20_000, 0)), LIMIT);
    }
    // The error changes sign: the output follows within a tick.
    assert!(wound.step(&gains, PERIOD, input(-1_000, 0)) < Value::ZERO);
}

#[test]
fn a_saturated_output_may_still_unwind() {
    let gains = Pidf { p: q16(0.0), i: q16(1.0), f: q16(10.0), ..Pidf::default() };
    let mut pid = Pid::default();
    pid.preset(&gains, value(10_000), value(0));
    let saturated = |error| PidInput { feed_forward: value(3_000), ..input(error, 0) };
    for _ in 0..10 {
        assert_eq!(pid.step(&gains, PERIOD, saturated(-500)), LIMIT);
    }
    let output = (0..10).map(|_| pid.step(&gains, PERIOD, saturated(-500))).last().expect("steps");
    assert!(output < LIMIT, "the integrator went on while it brought the output back");
}

#[test]
fn more_is_not_fed_forward_than_there_is() {
    let gains = Pidf { i: q16(1.0), f: q16(10.0), ..Pidf::default() };
    let fed = |error| PidInput { feed_forward: value(-40_000), ..input(error, 0) };
    let mut pid = Pid::default();
    assert_eq!(pid.step(&gains, PERIOD, fed(0)), -LIMIT);
    assert_eq!(pid.step(&gains, PERIOD, fed(500)), value(500) - LIMIT);
}

#[test]
fn a_preset_loop_goes_on_from_the_output_that_there_was() {
    let gains = Pidf { p: q16(2.0), i: q16(1.0), f: q16(3.0), d: q16(20.0) };
    let mut pid = Pid::default();
    for measured in 0..100 {
        pid.step(&gains, PERIOD, input(1000, 10 * measured));
    }
    pid.preset(&gains, value(5_000), value(700));
    // The error of the speed is 0, and the feed-forward is the speed.
    let there = PidInput { feed_forward: value(700), ..input(0, 700) };
    assert_eq!(pid.step(&gains, PERIOD, there), value(5_000));
    // Without an I term the loop cannot keep the preset output. The output is then the feed-forward alone.
    let gains = Pidf { i: Coefficient::ZERO, ..gains };
    pid.preset(&gains, value(5_000), value(700));
    assert_eq!(pid.step(&gains, PERIOD, there), value(2_100));
}

#[test]
fn no_input_or_coefficient_overflows() {
    for (period, bits) in [(1, i32::MAX), (100, i32::MAX), (1, i32::MIN), (100, i32::MIN)] {
        let most = Coefficient::from_bits(bits);
        let gains = Pidf { p: most, i: most, d: most, f: most };
        let period = Period::from_millis(period).expect("period");
        let ends = [i32::MIN, -i32::MAX, -1, 0, 1, i32::MAX].map(Value::from_bits);
        let mut pid = Pid::default();
        for error in ends {
            for measured in ends {
                for limit in [Value::ZERO, value(1), LIMIT, Value::MAX] {
                    let input = PidInput { error, measured, feed_forward: error.saturating_neg(), limit };
                    assert!(pid.step(&gains, period, input).abs() <= limit);
                }
            }
        }
    }
}
