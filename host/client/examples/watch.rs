//! Prints position and velocity of every motor ten times a second, until Ctrl-C:
//! `cargo run --example watch -- /dev/ttyACM0`, or `-- 127.0.0.1:7070` for a served hub.

use motor_hub_client::{Line, Session};
use std::time::Duration;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let place = std::env::args().nth(1).ok_or("where is the hub? Give a serial port or HOST:PORT")?;
    let timeout = Duration::from_secs(1);
    let line = if place.contains(':') { Line::tcp(&place, timeout)? } else { Line::serial(&place)? };
    let mut session = Session::with_parent(line, timeout)?;

    loop {
        let bulk = session.bulk()?;
        for (motor, (counts, cps)) in bulk.encoders.iter().zip(bulk.velocities).enumerate() {
            print!("motor {motor}: {counts:8} counts {cps:6} counts/s   ");
        }
        println!();
        std::thread::sleep(Duration::from_millis(100));
    }
}
