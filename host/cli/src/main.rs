//! The command line `motor-hub`. The file of a command reads its options and prints its results and errors.
//!
//! Exit codes: 0 done; 1 the command failed; 2 wrong options or input. A command checks its options and input before it
//! writes files.

// Only the handler of the Windows console has unsafe code.
#![cfg_attr(not(windows), forbid(unsafe_code))]
#![cfg_attr(windows, deny(unsafe_code))]

mod client;
mod compare;
mod constants;
mod dashboard;
mod documents;
mod emulate;
mod eval;
mod identify;
mod motors;
mod output;
mod parse;
mod points;
mod run;
mod scenario_options;
mod scheme_options;
mod serve;
#[cfg(unix)]
mod served_hubs;
mod soak;
mod survey;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use output::Failure;
use parse::with_negative_numbers;
use std::path::PathBuf;
use std::process::ExitCode;
use studies::table;

/// A hub for four gear motors with proportional braking, on a simulated board
///
/// Without a command it runs the default scenario: the hub's own tasks drive four simulated motors
/// for ten virtual seconds, once with proportional braking and once without.
///
/// Tables are as wide as the terminal, or as the variable COLUMNS says; else 80 columns.
#[derive(Parser)]
#[command(name = "motor-hub", version, args_conflicts_with_subcommands = true, max_term_width = 80)]
struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    run: run::Options,
}

#[derive(Subcommand)]
enum Command {
    Run(run::Options),
    Compare(compare::Options),
    Survey(survey::Options),
    Soak(soak::Options),
    Identify(identify::Options),
    Motors(motors::Options),
    #[command(override_usage = points::POINTS_USAGE)]
    Points(points::PointsOptions),
    #[command(override_usage = points::MAP_USAGE)]
    Map(points::MapOptions),
    /// Compare every number that the paper prints with ours, and list its misprints
    Paper {
        /// Print one JSON document instead of tables
        #[arg(long)]
        json: bool,
    },
    /// Draw the paper's figures, and the currents of control values, as SVG
    Figures {
        /// Folder for the figures
        #[arg(long, value_name = "DIR", default_value = "target/motor-hub/figures")]
        out: PathBuf,
    },
    Emulate(emulate::Options),
    Serve(serve::Options),
    Dashboard(dashboard::Options),
    Client(client::Options),
    Eval(eval::Options),
    /// Print a script with which a shell completes commands and options
    Completions {
        /// Shell that completes commands
        #[arg(value_name = "SHELL", ignore_case = true)]
        shell: Shell,
    },
    /// Write the manual pages of all commands
    Man {
        /// Folder for the pages
        #[arg(long, value_name = "DIR", default_value = "target/motor-hub/man")]
        out: PathBuf,
    },
}

fn main() -> ExitCode {
    let mut command = with_negative_numbers(Cli::command());
    let parsed = Cli::from_arg_matches_mut(&mut command.get_matches_mut());
    let cli = parsed.unwrap_or_else(|error| error.format(&mut command).exit());
    table::fit(output::columns().unwrap_or(table::USUAL_WIDTH));
    let done = match cli.command.unwrap_or(Command::Run(cli.run)) {
        Command::Run(options) => options.execute(),
        Command::Compare(options) => options.execute(),
        Command::Survey(options) => options.execute(),
        Command::Soak(options) => options.execute(),
        Command::Identify(options) => options.execute(),
        Command::Motors(options) => options.execute(),
        Command::Points(options) => options.execute(),
        Command::Map(options) => options.execute(),
        Command::Paper { json } => documents::paper(json),
        Command::Figures { out } => documents::figures(&out),
        Command::Emulate(options) => options.execute(),
        Command::Serve(options) => options.execute(),
        Command::Dashboard(options) => options.execute(),
        Command::Client(options) => options.execute(),
        Command::Eval(options) => options.execute(),
        Command::Completions { shell } => documents::completions(shell, Cli::command()),
        Command::Man { out } => documents::man(&out, Cli::command()),
    };
    done.map_or_else(Failure::report, |()| ExitCode::SUCCESS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Arg, Command as Clap};

    /// Parts of error messages of the standard library and of clap that name neither quantity nor unit.
    const BARE: [&str; 6] = [
        "invalid digit",
        "invalid float",
        "is not in",
        "cannot parse integer",
        "number too",
        "unexpected argument",
    ];

    /// Collects the errors for the values "-1", "99999999999999999999" and "x1" of each option and of each first
    /// argument.
    fn complaints(path: &[String], command: &Clap, all: &mut Vec<(String, String)>) {
        let takes_value = |arg: &&Arg| arg.get_action().takes_values() && !arg.is_trailing_var_arg_set();
        for arg in command.get_arguments().filter(takes_value) {
            if arg.get_index().is_some_and(|index| index > 1) {
                continue;
            }
            for value in ["-1", "99999999999999999999", "x1"] {
                let option = arg.get_long().map(|long| format!("--{long}"));
                let words = path.iter().cloned().chain(option).chain([value.to_owned()]);
                let words: Vec<String> = words.collect();
                if let Err(error) = with_negative_numbers(Cli::command()).try_get_matches_from(&words) {
                    all.push((words.join(" "), error.to_string()));
                }
            }
        }
        for inner in command.get_subcommands() {
            complaints(&[path, &[inner.get_name().to_owned()]].concat(), inner, all);
        }
    }

    /// Collects the short and the long help of each command.
    fn pages(path: &str, command: &mut Clap, all: &mut Vec<(String, String)>) {
        let both = [command.render_help(), command.render_long_help()];
        all.extend(both.map(|page| (path.to_owned(), page.to_string())));
        for inner in command.get_subcommands_mut() {
            pages(&format!("{path} {}", inner.get_name()), inner, all);
        }
    }

    #[test]
    fn every_help_page_fits_80_columns() {
        let mut command = with_negative_numbers(Cli::command());
        command.build();
        let mut all = Vec::new();
        pages("motor-hub", &mut command, &mut all);
        assert!(all.len() > 80, "{} pages", all.len());
        let wide: Vec<String> = all
            .iter()
            .flat_map(|(path, page)| page.lines().map(move |line| format!("{path}: {line}")))
            .filter(|line| line.split_once(": ").is_some_and(|(_, line)| line.chars().count() > 80))
            .collect();
        assert!(wide.is_empty(), "{}", wide.join("\n"));
    }

    #[test]
    fn an_error_of_a_value_names_quantity_and_unit() {
        let mut all = Vec::new();
        complaints(&["motor-hub".to_owned()], &Cli::command(), &mut all);
        assert!(all.len() > 100, "{} complaints", all.len());
        for (words, complaint) in all {
            let first = complaint.lines().next().expect("it says something");
            assert!(BARE.iter().all(|bare| !first.contains(bare)), "{words}: {complaint}");
        }
    }
}
