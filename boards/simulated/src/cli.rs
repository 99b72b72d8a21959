//! The command line `motor-hub`.
//!
//! Exit codes: 0 done, 1 something went wrong on the way, 2 wrong options or input. Nothing is
//! written before everything that can be checked has been.

mod ask;
mod client;
mod compare;
mod figures;
mod paper;
mod run;
mod serve;

pub use serve::Serving;

use crate::eval;
use clap::{Parser, Subcommand};
use std::process::ExitCode;

/// Why a command did not do what it was asked.
#[derive(Debug)]
pub enum Failure {
    /// The options or the input are wrong.
    Input(String),
    /// Something went wrong while it was at work.
    Work(String),
}

impl Failure {
    /// Says so, and gives the process's exit code.
    pub fn report(self) -> ExitCode {
        let (text, code) = match self {
            Self::Input(text) => (text, 2),
            Self::Work(text) => (text, 1),
        };
        eprintln!("error: {text}");
        ExitCode::from(code)
    }
}

/// A hub for four gear motors with proportional braking, on a simulated board
///
/// Without a command it runs the default scenario: the hub's own tasks drive four simulated motors
/// for ten virtual seconds, once with proportional braking and once without.
#[derive(Parser)]
#[command(name = "motor-hub", version, args_conflicts_with_subcommands = true)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::Options,
}

#[derive(Subcommand)]
enum Command {
    /// Runs a scenario with and without braking regime: tables, charts, CSV
    Run(run::Options),
    /// The same tasks under every scheme, with linear duty and with linear current
    #[command(long_about = compare::HELP)]
    Compare(compare::Options),
    /// The points S, T, Z, G at an operating point, computed by the firmware's core
    Points(ask::PointsOptions),
    /// What the firmware does with a control value at an operating point
    Map(ask::MapOptions),
    /// Every number that the paper prints beside ours, and where its text is wrong
    Paper(paper::Options),
    /// The paper's figures, and what becomes of a control value, as SVG and PNG
    Figures(figures::Options),
    /// A simulated hub in real time, for host software to talk to
    #[command(long_about = serve::HELP)]
    Serve(serve::Options),
    /// Commands for a hub on a serial port or TCP connection
    #[command(long_about = client::HELP)]
    Client(client::Options),
    /// The scripting interface: computes cases of a JSON document
    #[command(long_about = eval::HELP)]
    Eval(eval::Options),
}

/// Parses the process's arguments and does what they say.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let done = match cli.command.unwrap_or(Command::Run(cli.run)) {
        Command::Run(options) => options.execute(),
        Command::Compare(options) => options.execute(),
        Command::Points(options) => options.execute(),
        Command::Map(options) => options.execute(),
        Command::Paper(options) => options.execute(),
        Command::Figures(options) => options.execute(),
        Command::Serve(options) => options.execute(),
        Command::Client(options) => options.execute(),
        Command::Eval(options) => options.execute(),
    };
    done.map_or_else(Failure::report, |()| ExitCode::SUCCESS)
}

/// Prints a JSON document on standard output.
pub(crate) fn print_json(document: &impl serde::Serialize) -> Result<(), Failure> {
    let text = serde_json::to_string_pretty(document).map_err(|e| Failure::Work(e.to_string()))?;
    print(&format!("{text}\n"))
}

/// Prints to standard output; a reader that has gone away is a failure, not a panic.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    let done = out.write_all(text.as_bytes()).and_then(|()| out.flush());
    done.map_err(|e| Failure::Work(format!("standard output: {e}")))
}
