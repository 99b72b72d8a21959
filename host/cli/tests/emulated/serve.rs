//! The flashed image in real time, its serial line on this machine: the same host, and the same rules, as for
//! the simulated hub.

use crate::common::alone;
use crate::conformance::{Hub, conforms};

#[test]
#[ignore = "long: cargo xtask test nucleo-f429zi"]
fn the_image_conforms_over_its_serial_line() {
    let _alone = alone();
    conforms(&mut Hub::start(&["--emulated", "--tcp", "127.0.0.1:0"]).tcp());
}
