//! `cargo xtask figures`: draws the pictures of the documents with the program motor-hub.

use crate::generated::Generated;
use crate::tool::{Failed, cargo, root};
use std::fs;

/// The folder of the pictures that documents show.
const SHOWN: &str = "docs/pictures";

/// The folder that the program draws into.
const DRAWN: &str = "target/figures";

/// For each picture: the command that draws it, the file that the command writes, and the name of the file in the documents.
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
        // One picture needs the emulated chips. All use the same build of the program.
        let program = ["run", "--release", "--quiet", "--features", "emulated", "--"];
        cargo(&[&program[..], call, &["--out", &folder]].concat())?;
        let drawn = root().join(folder).join(file);
        let drawn = fs::read(&drawn).map_err(|error| Failed::at(&drawn, error))?;
        pictures.take(&format!("{SHOWN}/{shown}"), &drawn)?;
    }
    pictures.end()
}
