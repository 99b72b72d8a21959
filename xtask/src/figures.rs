//! `cargo xtask figures`: draws the pictures of the documents with the program motor-hub.

use crate::generated::Generated;
use crate::tool::{Failed, motor_hub, root};
use std::fs;

/// The folder of the pictures that documents show.
const SHOWN: &str = "docs/pictures";

/// The folder that the program draws into.
const DRAWN: &str = "target/figures";

/// For each picture: the command that draws it, the file that the command writes, and the name of the file in the documents.
const PICTURES: [(&[&str], &str, &str); 3] = [
    (&["run", "--scenario", "boards/simulated/scenarios/winch.toml"], "comparison.svg", "winch.svg"),
    (&["figures"], "11-current-at-50-percent.svg", "current.svg"),
    (&["emulate"], "overlay.svg", "overlay.svg"),
];

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    let mut pictures = Generated::new("figures", arguments)?;
    for (call, file, shown) in PICTURES {
        let folder = format!("{DRAWN}/{}", shown.replace('.', "-"));
        motor_hub(&[call, &["--out", &folder]].concat())?;
        let drawn = root().join(folder).join(file);
        let drawn = fs::read(&drawn).map_err(|error| Failed::at(&drawn, error))?;
        pictures.take(&format!("{SHOWN}/{shown}"), &drawn)?;
    }
    pictures.end()
}
