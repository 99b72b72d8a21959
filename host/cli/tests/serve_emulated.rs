//! The flashed image in real time, its serial line on this machine: the same host, and the same rules, as for
//! the simulated hub. In a program of its own, so that nothing else is at work meanwhile: real time is at stake.
#![expect(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::panic,
    reason = "a failed access is a failed test"
)]

mod conformance;

use conformance::{Hub, conforms};

#[test]
fn the_image_conforms_over_its_serial_line() {
    let program = env!("CARGO_BIN_EXE_motor-hub");
    conforms(&mut Hub::start(program, &["--emulated", "--tcp", "127.0.0.1:0"]).tcp());
}
