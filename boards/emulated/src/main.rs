//! `emulate`: see `emulate --help`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};
use emulated::emulate::{Overlay, on_a_line};
use emulated::{elf, serve};
use simulated::cli::{Failure, Serving};
use simulated::report::{drawn, write_all};
use simulated::scenario::Scenario;

/// The flashed image on an emulated chip, against the motor physics
///
/// Without a command: a scenario by the image, over the same on the simulated board. The image is built
/// first if it is not fresh; MOTOR_HUB_ELF names another one.
#[derive(Parser)]
#[command(name = "emulate", version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    /// Scenario file (TOML) instead of the default scenario; set-points come half a control period late
    #[arg(value_name = "SCENARIO")]
    scenario: Option<PathBuf>,
    /// Folder for the chart
    #[arg(value_name = "DIR", default_value = "target/emulated")]
    folder: PathBuf,
}

#[derive(Subcommand)]
enum Command {
    /// The image in real time behind the REV Hub Serial Protocol, for host software to talk to
    Serve(Serving),
}

fn overlay(cli: Cli) -> Result<(), Failure> {
    let scenario = match &cli.scenario {
        Some(file) => Scenario::load(file),
        None => Scenario::default_one(),
    };
    let scenario = on_a_line(scenario.map_err(Failure::Input)?);
    let overlay = Overlay::new(scenario, &mut |_| ()).map_err(Failure::Work)?;
    print!("{}", overlay.tables());
    let drawn = drawn(&[("overlay".to_owned(), overlay.figure())]).map_err(Failure::Work)?;
    for file in write_all(&cli.folder, drawn).map_err(Failure::Work)? {
        println!("{}", file.display());
    }
    Ok(())
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    let done = elf::check_named().map_err(Failure::Input).and_then(|()| match cli.command {
        Some(Command::Serve(serving)) => serving.execute(serve::scenario, serve::run),
        None => overlay(cli),
    });
    done.map_or_else(Failure::report, |()| ExitCode::SUCCESS)
}
