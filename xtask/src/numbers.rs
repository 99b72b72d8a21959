//! `cargo xtask numbers`: prints the numbers that the documents quote, and fails where one is not what the
//! tests allow.

use crate::tool::{Failed, REPORTS, cargo, cargo_command, motor_hub, none, output};

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    none(arguments)?;
    // Without naming their packages, which would build everything once more with fewer features.
    cargo(&["test", "--test", "linear_current", "--", "--nocapture"])?;
    let instructions = ["boot::", "budget::", "--include-ignored", "--skip", REPORTS];
    cargo(&[&["test", "--test", "image", "--", "--nocapture"][..], &instructions].concat())?;
    for command in ["paper", "figures", "compare"] {
        motor_hub(&[command])?;
    }
    // Its answers are tested elsewhere; here it must take the published cases.
    let eval = ["run", "--release", "--quiet", "--", "eval", "tests/data/golden.json"];
    output(&mut cargo_command(&eval)).map(|_| println!("eval takes tests/data/golden.json"))
}
