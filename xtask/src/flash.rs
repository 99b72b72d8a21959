//! `cargo xtask flash`: an image onto a board, by probe-rs.

use crate::board;
use crate::tool::{Failed, command, output, run};

const MISSING: &str =
    "probe-rs is missing, which flashes boards. Its guide (https://probe.rs) has an installer for
each system; or, with libudev-dev, pkg-config and cmake on Linux, build it:
    cargo install probe-rs-tools --locked";

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let board = board::named(arguments)?;
    // Before the build, which takes longer.
    output(command("probe-rs").arg("--version")).map_err(|_| Failed(MISSING.to_owned()))?;
    let image = board.build()?;
    // Neither a HardFault nor a reset stops in the debugger: the firmware opens its bridges and starts afresh.
    let unhalted = ["--no-catch-hardfault", "--no-catch-reset"];
    run(command("probe-rs").args(["run", "--chip", board.chip]).args(unhalted).arg(image))
}
