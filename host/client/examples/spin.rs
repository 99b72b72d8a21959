//! Runs motor 0 at 500 counts/s for three seconds:
//! `cargo run --example spin -- /dev/ttyACM0`, or `-- 127.0.0.1:7070` for a served hub.

use motor_hub_client::Session;
use motor_hub_client::motor_hub::{motor::ZeroPower, protocol::motor::RunMode};
use std::{thread::sleep, time::Duration};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut hub = Session::open(&std::env::args().nth(1).ok_or("where is the hub?")?)?;
    hub.set_mode(0, RunMode::Velocity, ZeroPower::Brake)?;
    hub.set_velocity(0, 500)?;
    hub.enable(0, true)?;
    for _ in 0..30 {
        println!("{} counts", hub.bulk()?.encoders[0]); // any request resets the hub's keep-alive
        sleep(Duration::from_millis(100));
    }
    Ok(hub.enable(0, false)?)
}
