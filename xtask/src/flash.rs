//! `cargo xtask flash`: writes an image to a board with probe-rs.

use crate::board;
use crate::tool::{Failed, command, output, run};

const INSTALL: &str = "Its guide (https://probe.rs) has an installer for
each system; or, with libudev-dev, pkg-config and cmake on Linux, build it:
    cargo install probe-rs-tools --locked";

/// The first version of probe-rs that has the options of [`UNHALTED`].
const LEAST: (u32, u32) = (0, 28);

/// Options with which the debugger does not stop the firmware at a HardFault or a reset. The firmware then opens its bridges, and
/// starts again.
const UNHALTED: [&str; 2] = ["--no-catch-hardfault", "--no-catch-reset"];

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let board = board::named(arguments)?;
    // The check comes before the build, which takes longer.
    check(&output(command("probe-rs").arg("--version")).unwrap_or_default())?;
    let image = board.build()?;
    run(command("probe-rs").args(["run", "--chip", board.chip]).args(UNHALTED).arg(image))
}

/// Checks the version that probe-rs prints. The text is empty if probe-rs is not installed.
fn check(says: &str) -> Result<(), Failed> {
    let why = match version(says) {
        Some(version) if version >= LEAST => return Ok(()),
        Some((major, minor)) => {
            format!("probe-rs {major}.{minor} is too old, {}.{} and later are good.", LEAST.0, LEAST.1)
        }
        None if says.is_empty() => "probe-rs is missing, which flashes boards.".to_owned(),
        None => format!("probe-rs says {:?} instead of its version.", says.trim_end()),
    };
    Err(Failed(format!("{why} {INSTALL}")))
}

/// Returns the first two numbers of a version text such as `probe-rs 0.29.1 (git commit: ...)`.
fn version(says: &str) -> Option<(u32, u32)> {
    let mut numbers = says.strip_prefix("probe-rs ")?.split('.');
    Some((numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_probe_rs_without_the_options_is_refused_with_what_to_install() {
        for good in ["probe-rs 0.28.0 (git commit: c2a6e1b)\n", "probe-rs 0.29.1", "probe-rs 1.0.0-rc.1"] {
            assert!(check(good).is_ok(), "{good}");
        }
        for (bad, why) in [
            ("probe-rs 0.27.0 (git commit: v0.27.0)", "probe-rs 0.27 is too old, 0.28 and later are good"),
            ("", "probe-rs is missing"),
            ("cargo-flash", "instead of its version"),
        ] {
            let Err(Failed(says)) = check(bad) else { panic!("{bad} is good") };
            assert!(says.contains(why) && says.contains("cargo install probe-rs-tools"), "{says}");
        }
    }
}
