//! `cargo xtask figures`: the pictures of the documents, drawn by the program that they tell of.

use crate::generated::Generated;
use crate::tool::{Failed, cargo, root};
use std::fs;

/// The folder of the pictures that documents show.
const SHOWN: &str = "docs/pictures";

/// Where they are drawn first.
const DRAWN: &str = "target/figures";

/// What is started, and which of the files that it writes is shown under which name.
const PICTURES: [(&[&str], &str, &str); 4] = [
    (&["run", "--scenario", "boards/simulated/scenarios/winch.toml"], "comparison.svg", "winch.svg"),
    (&["figures"], "11-current-at-50-percent.svg", "current.svg"),
    (&["figures"], "14-circuits.svg", "circuits.svg"),
    (&["emulate"], "overlay.svg", "overlay.svg"),
];

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let mut pictures = Generated::new("figures", arguments)?;
    for (call, file, shown) in PICTURES {
        let folder = format!("{DRAWN}/{}", shown.replace('.', "-"));
        // One of them needs the emulated chips; one way of building the program serves all.
        let program = ["run", "--release", "--quiet", "--features", "emulated", "--"];
        cargo(&[&program[..], call, &["--out", &folder]].concat())?;
        let drawn = root().join(folder).join(file);
        let drawn = fs::read(&drawn).map_err(|error| Failed::at(&drawn, error))?;
        pictures.take(&format!("{SHOWN}/{shown}"), &drawn)?;
    }
    pictures.end()
}
