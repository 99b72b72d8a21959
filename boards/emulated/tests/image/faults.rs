//! What goes wrong with one motor, and that the others do not mind. Every fault in every mode is in `matrix`.

use std::time::Duration;

use crate::common::{booted, four_loads, log, ms, time_to_safe, turning};
use emulated::{Bench, Encoder};

fn report(what: &str, time: Duration) {
    println!("time to safe: {:8.3} ms  {what}", time.as_secs_f64() * 1e3);
}

/// Motor 1 is safe in `limit`, and the others still follow their commands.
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
    bench.assert_sound();
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
    bench.assert_sound();
}

#[test]
pub(crate) fn a_bridge_that_switches_itself_off_stops_that_motor_alone_and_is_named() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.pull_diag(1, true);
    only_motor_1_stops(&mut bench, "bridge pulls its DIAG low", at, ms(65));
    // Latched: a bridge that works again changes nothing.
    bench.pull_diag(1, false);
    bench.run(ms(500));
    assert!(bench.lines(1).open());
    assert!(log(&mut bench).contains("motor 1: Faults"), "{}", log(&mut bench));
    assert!(log(&mut bench).contains("bridge: true"), "{}", log(&mut bench));
}
