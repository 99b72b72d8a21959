//! What goes wrong, what the bridges do meanwhile, and how long it takes until nothing is driven.

mod common;

use std::time::Duration;

use common::{booted, four_loads, log, ms, time_to_safe, turning};
use emulated::{Bench, Encoder};

/// The watchdog's time-out at the emulated LSI of 32 kHz, s: 0.5, plus one feeding interval.
const WATCHDOG: Duration = Duration::from_millis(515);

fn report(what: &str, time: Duration) {
    println!("time to safe: {:8.3} ms  {what}", time.as_secs_f64() * 1e3);
}

/// Sound but for the resets that it went through.
fn sound(bench: &mut Bench) {
    bench.assert_sound();
}

/// Motor 1 is safe in `limit`, and the others still do what they are told.
fn only_motor_1_stops(bench: &mut Bench, what: &str, since: Duration, limit: Duration) {
    bench.run_until(since + ms(1000));
    let time = time_to_safe(bench, 1, since);
    report(what, time);
    assert!(time <= limit, "{what}: {time:?}");
    for motor in [0, 2, 3] {
        let speed = bench.look(motor).counts_per_second;
        assert!((speed - 1000.0).abs() < 30.0, "motor {motor} turns at {speed} counts/s");
    }
    // Latched: an encoder that comes back changes nothing.
    bench.set_encoder(1, Encoder::Sound);
    bench.run(ms(500));
    assert!(bench.lines(1).open());
    sound(bench);
}

/// Presses the button; returns when motor 1 is first driven, to a millisecond.
fn started(bench: &mut Bench) -> Duration {
    bench.press(true);
    assert!(bench.run_while(ms(1), ms(100), |bench| !bench.lines(1).open()));
    bench.now()
}

#[test]
fn an_unplugged_encoder_stops_that_motor_alone() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.set_encoder(1, Encoder::Unplugged);
    // The case is clear once the velocity loop has wound itself up to half of the control range.
    only_motor_1_stops(&mut bench, "encoder unplugged while turning", at, ms(300));
    assert!(log(&mut bench).contains("encoder: Some(Stuck)"));
}

#[test]
fn an_encoder_unplugged_from_the_beginning_stops_that_motor_alone() {
    let mut bench = booted(four_loads());
    bench.set_encoder(1, Encoder::Unplugged);
    let at = started(&mut bench);
    only_motor_1_stops(&mut bench, "encoder never plugged in", at, ms(275));
}

#[test]
fn a_reversed_encoder_stops_that_motor_alone() {
    let mut bench = booted(four_loads());
    bench.set_encoder(1, Encoder::Reversed);
    let at = started(&mut bench);
    only_motor_1_stops(&mut bench, "encoder reversed", at, ms(275));
    assert!(log(&mut bench).contains("encoder: Some(Reversed)"));
}

#[test]
fn a_hard_stop_is_not_taken_for_an_unplugged_encoder() {
    let mut bench = booted(four_loads());
    bench.set_stops(1, Some((-100, 2000)));
    bench.press(true);
    bench.run(ms(5000));
    let look = bench.look(1);
    assert!((1900..=2000).contains(&look.counts), "{look:?}");
    bench.press(false);
    bench.run(ms(1500));
    bench.set_stops(1, None);
    bench.press(true);
    bench.run(ms(1500));
    for motor in 0..4 {
        let speed = bench.look(motor).counts_per_second;
        assert!((speed - 1000.0).abs() < 30.0, "motor {motor} turns at {speed} counts/s");
    }
    assert!(!log(&mut bench).contains("encoder: Some"), "{}", log(&mut bench));
    sound(&mut bench);
}

#[test]
fn a_dead_converter_stops_all_motors_and_a_live_one_lets_them_go_on() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.kill_adc(true);
    bench.run(ms(500));
    for motor in 0..4 {
        let time = time_to_safe(&mut bench, motor, at);
        if motor == 0 {
            report("converter dead", time);
        }
        assert!(time <= ms(165), "bridge {motor}: {time:?}");
    }
    bench.kill_adc(false);
    bench.run(ms(1500));
    for motor in 0..4 {
        let speed = bench.look(motor).counts_per_second;
        assert!((speed - 1000.0).abs() < 30.0, "motor {motor} turns at {speed} counts/s");
    }
    sound(&mut bench);
}

#[test]
fn a_sagging_battery_stops_all_motors_until_it_is_back() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.set_battery(4.0);
    bench.run(ms(500));
    for motor in 0..4 {
        let time = time_to_safe(&mut bench, motor, at);
        if motor == 0 {
            report("battery at 4 V", time);
        }
        assert!(time <= ms(165), "bridge {motor}: {time:?}");
    }
    bench.set_battery(12.0);
    bench.run(ms(1500));
    for motor in 0..4 {
        let speed = bench.look(motor).counts_per_second;
        assert!((speed - 1000.0).abs() < 30.0, "motor {motor} turns at {speed} counts/s");
    }
    sound(&mut bench);
}

#[test]
fn a_task_that_never_returns_ends_in_a_watchdog_reset() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.hang("capture");
    // Nobody sees the button any more; after the reset it is up.
    bench.press(false);
    bench.run(ms(700));
    let resets = bench.resets();
    assert_eq!(resets.len(), 1, "{resets:?}");
    assert!(resets[0].cause.contains("IWDG"), "{resets:?}");
    for motor in 0..4 {
        let time = time_to_safe(&mut bench, motor, at);
        if motor == 0 {
            report("a task hangs", time);
        }
        assert!(time <= WATCHDOG, "bridge {motor}: {time:?}");
    }
    assert!(log(&mut bench).contains("started by the watchdog"), "{}", log(&mut bench));
    sound(&mut bench);
}

#[test]
fn a_bus_error_opens_the_bridges_at_once_and_the_watchdog_starts_afresh() {
    let mut bench = turning(four_loads());
    // The next read of TIM2's counter.
    bench.fail_next_access(0x4000_0024..0x4000_0028);
    let at = bench.now();
    bench.run(ms(1100));
    for motor in 0..4 {
        let opened = first_open(&mut bench, motor, at);
        if motor == 0 {
            report("bus error", opened);
        }
        // The next sample comes within a millisecond.
        assert!(opened <= Duration::from_micros(1050), "bridge {motor}: {opened:?}");
    }
    let text = log(&mut bench);
    assert!(text.contains("HardFault"), "{text}");
    assert_eq!(bench.resets().len(), 1);
    sound(&mut bench);
}

/// When a bridge was first open after `since`.
fn first_open(bench: &mut Bench, motor: usize, since: Duration) -> Duration {
    let transitions = bench.transitions();
    let found = transitions.iter().find(|t| t.motor == motor && t.at >= since && t.lines.open());
    found.expect("the bridge opened").at - since
}

#[test]
fn a_reset_in_mid_run_opens_the_bridges_until_the_button_is_pressed_anew() {
    let mut bench = turning(four_loads());
    let at = bench.now() + ms(10);
    bench.pull_reset(at);
    bench.run(ms(11));
    for motor in 0..4 {
        let time = time_to_safe(&mut bench, motor, at);
        if motor == 0 {
            report("reset pin", time);
        }
        assert_eq!(time, Duration::ZERO, "bridge {motor}");
    }
    // It is still held.
    bench.run(ms(1500));
    assert!((0..4).all(|motor| bench.lines(motor).open()));
    bench.press(false);
    bench.run(ms(50));
    bench.press(true);
    bench.run(ms(1500));
    for motor in 0..4 {
        let speed = bench.look(motor).counts_per_second;
        assert!((speed - 1000.0).abs() < 30.0, "motor {motor} turns at {speed} counts/s");
    }
    assert_eq!(bench.resets().len(), 1);
    sound(&mut bench);
}

#[test]
fn a_bridge_that_switches_itself_off_stops_that_motor_alone_and_is_named() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.pull_diag(1, true);
    only_motor_1_stops(&mut bench, "bridge pulls its DIAG low", at, ms(65));
    // Latched: that of a bridge that has come to again changes nothing.
    bench.pull_diag(1, false);
    bench.run(ms(500));
    assert!(bench.lines(1).open());
    assert!(log(&mut bench).contains("motor 1: Faults"), "{}", log(&mut bench));
    assert!(log(&mut bench).contains("bridge: true"), "{}", log(&mut bench));
}
