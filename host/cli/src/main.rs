//! The command line `motor-hub`: one file a command. Options are read here, errors are put into words here, and
//! nothing else is decided here.
//!
//! Exit codes: 0 done, 1 something went wrong on the way, 2 wrong options or input. Nothing is
//! written before everything that can be checked has been.

#![forbid(unsafe_code)]

mod choice;
mod client;
mod compare;
mod constants;
mod emulate;
mod eval;
mod figures;
mod identify;
mod map;
mod motors;
mod operating;
mod output;
mod paper;
mod parse;
mod points;
mod run;
mod serve;
mod soak;
mod source;
mod survey;

use clap::{Parser, Subcommand};
use output::Failure;
use std::process::ExitCode;

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
    /// How well motors are regulated: reference tasks, bare motors, scenarios by lot
    #[command(long_about = survey::HELP)]
    Survey(survey::Options),
    /// Hours of scenarios by lot: counts false alarms and starved watchdogs
    #[command(long_about = soak::HELP)]
    Soak(soak::Options),
    /// What the hub learns of its motors from a short motion, beside what they are: tables and a chart
    #[command(long_about = identify::HELP)]
    Identify(identify::Options),
    /// The motors that are known: names, aliases, counts, speeds, currents
    Motors(motors::Options),
    /// The points S, T, Z, G at an operating point, computed by the firmware's core
    Points(points::Options),
    /// What the firmware does with a control value at an operating point
    Map(map::Options),
    /// Every number that the paper prints beside ours, and where its text is wrong
    Paper(paper::Options),
    /// The paper's figures, and what becomes of a control value, as SVG and PNG
    Figures(figures::Options),
    /// The flashed image on an emulated chip, over the same core on the simulated board
    #[command(long_about = emulate::HELP)]
    Emulate(emulate::Options),
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

fn main() -> ExitCode {
    let cli = Cli::parse();
    let done = match cli.command.unwrap_or(Command::Run(cli.run)) {
        Command::Run(options) => options.execute(),
        Command::Compare(options) => options.execute(),
        Command::Survey(options) => options.execute(),
        Command::Soak(options) => options.execute(),
        Command::Identify(options) => options.execute(),
        Command::Motors(options) => options.execute(),
        Command::Points(options) => options.execute(),
        Command::Map(options) => options.execute(),
        Command::Paper(options) => options.execute(),
        Command::Figures(options) => options.execute(),
        Command::Emulate(options) => options.execute(),
        Command::Serve(options) => options.execute(),
        Command::Client(options) => options.execute(),
        Command::Eval(options) => options.execute(),
    };
    done.map_or_else(Failure::report, |()| ExitCode::SUCCESS)
}
