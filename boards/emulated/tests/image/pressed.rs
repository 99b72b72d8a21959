//! The button of the board must not drive motors once a host has sent a packet, also not after the host has gone. `running` tests
//! how the button drives motors without a host.

use crate::common::{am60, booted, ms, turning, with_host};
use emulated::Bench;
use emulated::host_link::HostLink;

fn all_open(bench: &mut Bench) -> bool {
    (0..bench.motors()).all(|motor| bench.lines(motor).open())
}

fn press_anew(bench: &mut Bench) {
    bench.press(false);
    bench.run(ms(50));
    bench.press(true);
    bench.run(ms(500));
}

#[test]
fn a_host_that_speaks_ends_what_the_button_began_and_disarms_it() {
    let mut bench = turning(vec![am60(); 4]);
    let mut host = HostLink::default();
    host.keep_alive(&mut bench);
    bench.run(ms(100));
    assert!(all_open(&mut bench));
    bench.press(false);
    bench.run(ms(100));
    bench.press(true);
    bench.run(ms(1000));
    assert!(all_open(&mut bench));
    // The button also has no effect after the host has gone.
    bench.press(false);
    bench.run(ms(3000));
    bench.press(true);
    bench.run(ms(500));
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
        let speed = bench.look(0).counts_per_second;
        assert!((speed + 1000.0).abs() < 100.0, "{phase} ms: {speed} counts/s");
    }
}

#[test]
fn the_button_does_not_change_the_motors_of_a_host() {
    let (mut bench, mut host) = with_host(vec![am60(); 4]);
    host.velocity(&mut bench, 0, 1000);
    bench.run(ms(1500));
    bench.press(true);
    host.keep_alive(&mut bench);
    bench.run(ms(500));
    bench.press(false);
    bench.run(ms(500));
    let speed = bench.look(0).counts_per_second;
    assert!((speed - 1000.0).abs() < 30.0, "{speed} counts/s");
    bench.assert_sound();
}

#[test]
fn the_button_starts_no_motor_on_a_low_battery() {
    let mut bench = booted(vec![am60(); 4]);
    bench.set_battery(6.5);
    bench.run(ms(200));
    bench.press(true);
    bench.run(ms(500));
    assert!(all_open(&mut bench));
    // The motors also do not start when the battery recovers while the button is held.
    bench.set_battery(12.0);
    bench.run(ms(500));
    assert!(all_open(&mut bench));
    press_anew(&mut bench);
    assert!(!all_open(&mut bench));
    bench.assert_sound();
}
