//! Runs motor 0 at 500 counts/s for three seconds:
//! `cargo run --example spin -- /dev/ttyACM0`, or `-- 127.0.0.1:7070` for a served hub.

use motor_hub_client::motor_hub::motor::ZeroPower;
use motor_hub_client::motor_hub::protocol::motor::RunMode;
use motor_hub_client::{Line, Session};
use std::time::{Duration, Instant};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let place = std::env::args().nth(1).ok_or("where is the hub? Give a serial port or HOST:PORT")?;
    let timeout = Duration::from_secs(1);
    let line = if place.contains(':') { Line::tcp(&place, timeout)? } else { Line::serial(&place)? };
    let mut session = Session::with_parent(line, timeout)?;

    session.set_mode(0, RunMode::Velocity, ZeroPower::Brake)?;
    session.set_velocity(0, 500)?;
    session.enable(0, true)?;

    // The hub lets its motors go when it hears nothing for 2.5 s.
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(3) {
        session.keep_alive()?;
        std::thread::sleep(Duration::from_millis(500));
    }
    session.enable(0, false)?;
    Ok(())
}
