//! A fault of one motor stops this motor, and leaves the others running. `matrix` has every fault in every mode.

use std::time::Duration;

use crate::common::{booted, counts_in, four_loads, log, ms, time_to_safe, turning};
use emulated::{Bench, Encoder};

/// Expects that the bridge of motor 1 opens within `limit` and stays open, and that the other motors keep their speed.
fn only_motor_1_stops(bench: &mut Bench, what: &str, since: Duration, limit: Duration) {
    bench.run_until(since + ms(1000));
    let time = time_to_safe(bench, 1, since);
    println!("time to safe: {:8.3} ms  {what}", time.as_secs_f64() * 1e3);
    assert!(time <= limit, "{what}: {time:?}");
    // The fault is latched: a repaired encoder does not enable the motor.
    bench.set_encoder(1, Encoder::Sound);
    let turned = counts_in(bench, ms(500));
    // At 1000 counts/s a sample may have no count although the motor turns, and the speed then changes by 5 % for a moment.
    for motor in [0, 2, 3] {
        let mean = turned[motor] as f64 / 0.5;
        assert!((mean - 1000.0).abs() < 30.0, "{what}: motor {motor} turns at {mean} counts/s");
    }
    assert!(bench.lines(1).open());
    bench.assert_sound();
}

/// Presses the button. Returns the time at which motor 1 is first driven, with a resolution of a millisecond.
fn started(bench: &mut Bench) -> Duration {
    bench.press(true);
    assert!(bench.run_while(ms(1), ms(100), |bench| !bench.lines(1).open()));
    bench.now()
}

#[test]
fn a_faulty_encoder_stops_its_motor_alone() {
    for (encoder, is_turning, fault) in [
        (Encoder::Unplugged, true, "Stuck"),
        (Encoder::Unplugged, false, "Stuck"),
        (Encoder::Reversed, false, "Reversed"),
    ] {
        let mut bench = if is_turning { turning(four_loads()) } else { booted(four_loads()) };
        bench.set_encoder(1, encoder);
        let at = if is_turning { bench.now() } else { started(&mut bench) };
        // The hub decides once the velocity loop requests half of the control range, which a turning motor does later.
        let limit = if is_turning { ms(300) } else { ms(275) };
        only_motor_1_stops(&mut bench, &format!("{encoder:?}, turning: {is_turning}"), at, limit);
        assert!(log(&mut bench).contains(&format!("encoder: Some({fault})")), "{}", log(&mut bench));
    }
}

#[test]
pub(crate) fn a_bridge_that_switches_itself_off_stops_that_motor_alone_and_is_named() {
    let mut bench = turning(four_loads());
    let at = bench.now();
    bench.pull_diag(1, true);
    only_motor_1_stops(&mut bench, "bridge pulls its DIAG low", at, ms(65));
    // The fault is latched: a bridge that works again does not enable the motor.
    bench.pull_diag(1, false);
    bench.run(ms(500));
    assert!(bench.lines(1).open());
    assert!(log(&mut bench).contains("motor 1: Faults"), "{}", log(&mut bench));
    assert!(log(&mut bench).contains("bridge: true"), "{}", log(&mut bench));
}
