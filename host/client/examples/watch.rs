//! Prints position and velocity of every motor ten times a second, until Ctrl-C:
//! `cargo run --example watch -- /dev/ttyACM0`, or `-- 127.0.0.1:7070` for a served hub.

use motor_hub_client::Session;
use std::{thread::sleep, time::Duration};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut hub = Session::open(&std::env::args().nth(1).ok_or("where is the hub?")?)?;
    loop {
        let bulk = hub.bulk()?;
        println!("counts {:?}, counts/s {:?}", bulk.encoders, bulk.velocities);
        sleep(Duration::from_millis(100));
    }
}
