//! The image in real time, its serial line on this machine: the same host, and the same rules, as for the
//! simulated hub.

#[path = "../../simulated/tests/conformance/mod.rs"]
mod conformance;

use conformance::{Hub, conforms};

#[test]
fn the_image_conforms_over_its_serial_line() {
    conforms(&mut Hub::start(env!("CARGO_BIN_EXE_emulate"), &["--tcp", "127.0.0.1:0"]).tcp());
}
