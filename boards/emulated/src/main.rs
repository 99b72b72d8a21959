//! `emulate`: a scenario by the flashed image on the emulated chip, over the same on the simulated board.

use std::path::PathBuf;
use std::process::ExitCode;

use emulated::emulate::{Overlay, scenario};
use simulated::report::{drawn, write_all};
use simulated::scenario::Scenario;

/// Usage: `emulate [SCENARIO.toml] [FOLDER]`.
fn run() -> Result<(), String> {
    let mut arguments = std::env::args().skip(1);
    let scenario = match arguments.next() {
        Some(file) => Scenario::load(&PathBuf::from(file))?,
        None => scenario()?,
    };
    let folder = PathBuf::from(arguments.next().unwrap_or_else(|| "target/emulated".to_owned()));
    let overlay = Overlay::new(scenario, &mut |_| ())?;
    print!("{}", overlay.tables());
    for file in write_all(&folder, drawn(&[("overlay".to_owned(), overlay.figure())])?)? {
        println!("{}", file.display());
    }
    Ok(())
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(reason) => {
            eprintln!("{reason}");
            ExitCode::FAILURE
        }
    }
}
