//! How fast virtual time passes: four motors at free speed, 10,100 encoder edges a second.
//!
//! `cargo test --release -p emulated --test image speed -- --ignored --nocapture`

use std::time::{Duration, Instant};

use crate::common::{am60, booted_as, ms, setup};
use emulated::host_link::HostLink;
use emulated::{Pwm, Setup};

/// Prints how many virtual seconds pass in a real second.
fn rate(pwm: Pwm) {
    let mut bench = booted_as(Setup { pwm, ..setup(vec![am60(); 4]) });
    let mut host = HostLink::default();
    for motor in 0..4 {
        // The power is nearly full, so that TIM1 still makes pulses.
        host.power(&mut bench, motor, 32_000);
    }
    // Runs for 2 s, until the emulator has translated the firmware.
    for _ in 0..2 {
        bench.run(ms(1000));
        host.keep_alive(&mut bench);
    }
    let edges: i64 = (0..4).map(|motor| bench.look(motor).counts).sum();
    let start = Instant::now();
    for _ in 0..5 {
        bench.run(Duration::from_secs(1));
        host.keep_alive(&mut bench);
    }
    let rate = 5.0 / start.elapsed().as_secs_f64();
    let edges = (0..4).map(|motor| bench.look(motor).counts).sum::<i64>() - edges;
    println!("{pwm:?}: {rate:.1} times real time with {} edges/s", edges / 5);
}

#[test]
#[ignore = "a report, not a test"]
fn report_of_virtual_time_against_real_time() {
    for pwm in [Pwm::Registers, Pwm::Emulated] {
        rate(pwm);
    }
}
