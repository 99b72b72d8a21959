//! `cargo xtask second`: boots the image of a NUCLEO-F429ZI on a second emulator, Unicorn.

use crate::board::named;
use crate::python::environment;
use crate::tool::{Failed, none, root, run};
use std::process::Command;

pub(crate) fn task(arguments: &[String]) -> Result<(), Failed> {
    none(arguments)?;
    let image = named(&["nucleo-f429zi".to_owned()])?.build()?;
    match environment("second", &["unicorn==2.1.4", "pyelftools==0.33"]) {
        Ok(python) => {
            run(Command::new(python).arg(root().join("boards/emulated/second_emulator.py")).arg(image))
        }
        Err(Failed(why)) => {
            println!("SKIPPED: Unicorn cannot be installed here: {why}");
            Ok(())
        }
    }
}
