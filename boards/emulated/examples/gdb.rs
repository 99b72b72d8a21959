//! Runs the emulated hub under GDB. Run `cargo run --release --package emulated --example gdb`. Then run
//! `gdb-multiarch target/images/nucleo-f429zi` in another terminal, and enter these commands:
//!
//! ```text
//! (gdb) target remote :3333
//! (gdb) break motor_hub::hub::Hub<4>::step
//! (gdb) continue
//! ```
//!
//! Set a breakpoint before the first `continue`. A sleeping core takes no real time, so without a breakpoint the run
//! would end before you can type. Button B1 is pressed after 300 ms. While GDB halts the core, virtual time and the
//! motors stop. The run ends after 10 virtual seconds.

use std::time::Duration;

use emulated::{Bench, Mounting, Setup};
use motor_hub::model::catalogue::characterised;
use motor_hub::model::load::Load;
use motor_hub::model::switching::Bridge;

fn main() {
    let motor = characterised("AM 60 A").expect("in the catalogue");
    let motor = motor.with_measured_rotor_inertia();
    let mounting = Mounting { motor, load: Load::NONE, bridge: Bridge::IDEAL, stops: None };
    println!("waiting for GDB on localhost:3333");
    let mut bench = Bench::new(Setup { gdb: Some(3333), ..Setup::new(vec![mounting; 4]) });
    bench.run(Duration::from_millis(300));
    bench.press(true);
    bench.run(Duration::from_millis(9_700));
    for line in bench.log() {
        println!("{line}");
    }
}
