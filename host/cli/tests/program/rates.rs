//! How often a hub can be asked what all its motors do.
//!
//! `cargo test --test program report_of_four -- --ignored --nocapture`

use crate::common::{PROGRAM, alone};
use crate::conformance::Hub;
use motor_hub_client::Session;
use std::time::Instant;

const ASKED: u32 = 500;

fn rate(name: &str, arguments: &[&str]) {
    let hub = Hub::start(PROGRAM, arguments);
    let mut session = Session::open(&hub.place).unwrap();
    // What the emulator executes for the first time takes it a while, which is no answer then.
    for _ in 0..20 {
        let _ = session.report();
    }
    let mut times: Vec<f64> = Vec::new();
    for _ in 0..ASKED {
        let begun = Instant::now();
        assert_eq!(session.report().unwrap().unwrap().motors.len(), 4);
        session.battery().unwrap();
        times.push(begun.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    let (mean, p99) = (times.iter().sum::<f64>() / f64::from(ASKED), times[times.len() * 99 / 100]);
    println!(
        "{name}: {:.0} a second, {:.1} ms each, 99 % within {:.1} ms",
        1.0 / mean,
        1e3 * mean,
        1e3 * p99
    );
}

#[test]
#[ignore = "a report, not a test: times are this machine's"]
fn report_of_four_motors_and_the_battery_over_every_line() {
    let _alone = alone();
    rate("TCP", &["--tcp", "127.0.0.1:0"]);
    #[cfg(unix)]
    rate("pseudo-terminal", &["--pty"]);
    #[cfg(feature = "emulated")]
    rate("emulated chip, TCP", &["--emulated", "--tcp", "127.0.0.1:0"]);
    #[cfg(all(unix, feature = "emulated"))]
    rate("emulated chip, pseudo-terminal", &["--emulated", "--pty"]);
}
