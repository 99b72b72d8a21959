//! Regulated motors on the chip, started by the button, without a host. `matrix` has every fault in every mode.

use crate::common::{am60, booted, counts_in, expect_motor, expect_speed, four_loads, log, ms, turning};
use emulated::host_link::HostLink;
use emulated::{Bench, Lines};

#[test]
pub(crate) fn four_motors_with_different_loads_reach_their_speed_and_stand_still_again() {
    let mut bench = turning(four_loads());
    bench.run(ms(1000));
    // The estimate is wrong by up to one sampling interval in its window, which is 2 %.
    expect_speed(&mut bench, 0..4, 30.0);
    let released = bench.now();
    bench.press(false);
    bench.run(ms(800));
    let transitions = bench.transitions();
    let brakes = |lines: Lines| !lines.ina && !lines.inb && !lines.open();
    let braked = |motor| transitions.iter().any(|t| t.at > released && t.motor == motor && brakes(t.lines));
    // A heavy motor needs mode 6/2 until it stands.
    assert!([0, 3].into_iter().all(braked), "mode 5/0 slows light motors down");
    // The hub holds the motors at standstill. A held motor without friction moves within four counts.
    for (motor, moved) in counts_in(&mut bench, ms(150)).into_iter().enumerate() {
        assert!(moved.abs() <= 4, "motor {motor} moved {moved} counts");
    }
    bench.run(ms(350));
    for motor in 0..4 {
        assert!(bench.lines(motor).open());
    }
    assert!(!log(&mut bench).contains("encoder: Some"), "{}", log(&mut bench));
    bench.assert_sound();
}

#[test]
pub(crate) fn the_log_shows_the_speeds_and_the_voltage_of_the_physics() {
    let mut bench = turning(four_loads());
    bench.run(ms(2500));
    let text = log(&mut bench);
    // Returns the last number that follows these words.
    let read = |before: &str| -> f64 {
        let (_, rest) = text.rsplit_once(before).expect("a log line");
        let number = rest.split([' ', ')']).next().expect("a word");
        number.parse().expect("a number")
    };
    let speeds: [f64; 4] = std::array::from_fn(|motor| read(&format!("motor {motor}: ")));
    for (motor, speed) in speeds.into_iter().enumerate() {
        // One sampling interval of 1 ms in the window of 50 ms is 2 %. The loop still settles, so the present speed
        // differs from the mean speed of the window.
        let real = bench.look(motor).counts_per_second;
        assert!((speed - real).abs() < 0.04 * real, "motor {motor}: {speed} read, {real} real");
    }
    let millivolts = read("Millivolts(");
    let (volts, _) = bench.battery();
    // The F429's converter resolves 7.4 mV of battery voltage. The filter lags by 40 ms.
    assert!((millivolts - 1000.0 * volts).abs() < 30.0, "{millivolts:?} mV read, {volts} V real");
}

#[test]
fn the_same_image_runs_the_same_way_twice() {
    let run = || {
        let mut bench = booted(four_loads());
        bench.press(true);
        bench.run(ms(700));
        (bench.transitions(), bench.log(), bench.instructions(), bench.look(2))
    };
    // In the second run the emulator has already translated the code.
    assert_eq!(run(), run());
}

/// `tests/button.rs` and `tests/responder` of the library have all that forbids the button.
#[test]
fn the_button_drives_no_motor_on_a_low_battery_nor_once_a_host_has_spoken() {
    let mut bench = booted(vec![am60(); 4]);
    let all_open = |bench: &mut Bench| (0..4).all(|motor| bench.lines(motor).open());
    let press_anew = |bench: &mut Bench| {
        bench.press(false);
        bench.run(ms(100));
        bench.press(true);
        bench.run(ms(500));
    };
    bench.set_battery(6.5);
    bench.run(ms(200));
    press_anew(&mut bench);
    assert!(all_open(&mut bench));
    // The motors also do not start when the battery recovers while the button is held.
    bench.set_battery(12.0);
    bench.run(ms(500));
    assert!(all_open(&mut bench));
    press_anew(&mut bench);
    assert!((0..4).all(|motor| !bench.lines(motor).open()));
    // The first packet of a host disables the motors and the button.
    let mut host = HostLink::default();
    host.keep_alive(&mut bench);
    bench.run(ms(100));
    assert!(all_open(&mut bench));
    host.velocity(&mut bench, 0, -1000);
    bench.run(ms(1000));
    host.keep_alive(&mut bench);
    press_anew(&mut bench);
    expect_motor(&mut bench, 0, -1000.0, 30.0);
    assert!((1..4).all(|motor| bench.lines(motor).open()));
    // The button also has no effect after the host has gone.
    bench.run(ms(2_600));
    assert!(all_open(&mut bench));
    press_anew(&mut bench);
    assert!(all_open(&mut bench));
    bench.assert_sound();
}

#[test]
fn a_motor_that_a_host_enables_in_its_first_milliseconds_keeps_running_though_the_button_is_held() {
    // The task of the button polls every 10 ms. A host sets and enables a motor in less time.
    for phase in [0, 3, 6] {
        let mut bench = turning(vec![am60()]);
        bench.run(ms(phase));
        HostLink::default().velocity(&mut bench, 0, -1000);
        bench.run(ms(1500));
        expect_motor(&mut bench, 0, -1000.0, 100.0);
    }
}

#[test]
pub(crate) fn a_bridge_that_switches_itself_off_stops_its_own_motor() {
    let mut bench = turning(four_loads());
    for motor in 0..4 {
        bench.pull_diag(motor, true);
        bench.run(ms(100));
        let open = [0, 1, 2, 3].map(|other| bench.lines(other).open());
        assert_eq!(open, [0, 1, 2, 3].map(|other| other <= motor));
    }
    bench.assert_sound();
}
