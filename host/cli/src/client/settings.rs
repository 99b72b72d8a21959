//! `motor-hub client settings`.

mod document;

use super::trouble::Trouble;
use crate::output::{Failure, print, print_json};
use document::Document;
use motor_hub::protocol::Request;
use motor_hub::protocol::store::{StoreReport, ToStore};
use motor_hub::store::{Outcome, Stored};
use motor_hub_client::Session;
use motor_hub_client::line::Line;
use motor_hub_client::why::why_unsaved;
use serde_json::json;
use simulated::scenario::line_and_column;
use std::path::{Path, PathBuf};
use studies::table;

/// Text of the long help.
pub(super) const HELP: &str = "\
Settings that outlast power, on hubs of this project: shows, saves, resets, exports, imports

Whatever else sets something (setup, coefficients, identify --apply, tune --apply, import) puts it in force until the next \
reset; `save` makes it last. Of each motor that is its set-up, how it moves, what protects it, how its bridge switches, its \
mode, its current alert, and the coefficients that a host gave; of the hub its address, which set-address stores by itself.

A power cut during a save leaves what was stored before, or all of the new. A save now and then erases flash, for \
which all motors must be off; this program has them off.";

#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    /// What is stored, and whether it is what is in force
    Show {
        /// JSON instead of a table
        #[arg(long)]
        json: bool,
    },
    /// Stores the settings in force
    Save,
    /// Puts in force what is stored, but for the address
    Load,
    /// Puts in force what the firmware has, and stores that: nothing is left but the address until the next reset
    Reset,
    /// Writes the settings in force as TOML: to a file, or to standard output
    Export {
        #[arg(value_name = "FILE")]
        file: Option<PathBuf>,
    },
    /// Puts settings of a file in force, all of which are checked before any is written; the address is left
    Import {
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Stores them too
        #[arg(long)]
        save: bool,
    },
}

impl Options {
    /// What can be wrong before a hub is asked.
    pub(super) fn check(&self) -> Result<(), Failure> {
        match &self.command {
            Command::Import { file, .. } => read(file).map(drop),
            _ => Ok(()),
        }
    }

    pub(super) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let done = match self.command {
            Command::Show { json } => return show(&session.stored()?, json),
            Command::Save => saved(session)?,
            Command::Load => {
                let report = session.store(ToStore::Load)?;
                ended(&report)?;
                format!("in force is what is stored: {}", describe(&report))
            }
            Command::Reset => {
                ended(&session.store(ToStore::Reset)?)?;
                "in force, and stored, is what the firmware has".to_owned()
            }
            Command::Export { file } => {
                let text = Document::of(session)?.to_toml()?;
                let Some(file) = file else { return Ok(print(&text)?) };
                std::fs::write(&file, text).map_err(|error| at(&file, error))?;
                format!("wrote {}", file.display())
            }
            Command::Import { file, save } => {
                let requests = read(&file)?;
                for request in requests {
                    session.order(request)?;
                }
                let in_force = format!("in force is what {} says", file.display());
                if save { format!("{in_force}\n{}", saved(session)?) } else { in_force }
            }
        };
        Ok(print(&format!("{done}\n"))?)
    }
}

fn saved(session: &mut Session<Line>) -> Result<String, Trouble> {
    let report = session.store(ToStore::Save)?;
    ended(&report)?;
    Ok(format!("stored: {}", describe(&report)))
}

/// What a file says, as requests that put it in force.
fn read(file: &Path) -> Result<Vec<Request>, Failure> {
    let text = std::fs::read_to_string(file)
        .map_err(|error| Failure::Input(format!("{}: {error}", file.display())))?;
    let document: Document = toml::from_str(&text).map_err(|error| {
        let (line, column) = line_and_column(&text, error.span().unwrap_or_default().start);
        Failure::Input(format!("{}:{line}:{column}: {}", file.display(), error.message()))
    })?;
    document.requests().map_err(|error| Failure::Input(format!("{}: {}", file.display(), error.trim_end())))
}

fn at(file: &Path, error: std::io::Error) -> Failure {
    Failure::Work(format!("{}: {error}", file.display()))
}

/// How an order ended that the hub took.
fn ended(report: &StoreReport) -> Result<(), Failure> {
    let why = match why_unsaved(report) {
        _ if report.at_work => "the hub is still at it",
        Some(why) => why,
        None => return Ok(()),
    };
    Err(Failure::work(why))
}

fn describe(report: &StoreReport) -> String {
    let StoreReport { number, version, .. } = report;
    match report.stored {
        Stored::Nothing => "nothing".to_owned(),
        Stored::Whole => format!("save {number}"),
        Stored::OneCopy => format!("save {number}, of which one copy is damaged or older: save again"),
        Stored::Later => format!(
            "settings of a later firmware (version {version}), kept and not in force; `reset` drops them"
        ),
        Stored::Damaged => "something that makes no sense; `reset` clears it".to_owned(),
    }
}

fn show(report: &StoreReport, json: bool) -> Result<(), Trouble> {
    let StoreReport { stored, version, number, at_work, outcome, differs, unknown, refused, .. } = *report;
    if json {
        let stored = match stored {
            Stored::Nothing => "nothing",
            Stored::Whole => "whole",
            Stored::OneCopy => "one-copy",
            Stored::Later => "later",
            Stored::Damaged => "damaged",
        };
        let outcome = match outcome {
            Outcome::None => None,
            Outcome::Done => Some("done"),
            Outcome::NeedsErase => Some("needs-erase"),
            Outcome::Refused => Some("refused"),
            Outcome::Lost => Some("lost"),
        };
        let document = json!({
            "stored": stored,
            "version": version,
            "number": number,
            "at_work": at_work,
            "outcome": outcome,
            "differs": differs,
            "unknown_entries": unknown,
            "refused_entries": refused,
        });
        return Ok(print_json(&document)?);
    }
    let mut table = table::new(&["stored", &describe(report)], 1);
    table.add_row([
        "in force",
        if differs { "something else: it lasts until the next reset" } else { "the same" },
    ]);
    if unknown > 0 {
        table.add_row(["of another firmware", &format!("{unknown} entries, which are kept")]);
    }
    if refused > 0 {
        table.add_row([
            "out of range",
            &format!("{refused} entries, for which the firmware's own are in force"),
        ]);
    }
    if let Err(Failure::Work(why) | Failure::Input(why)) = ended(report) {
        table.add_row(["last time", &why]);
    }
    Ok(print(&format!("{table}\n"))?)
}
