//! Implements the command `motor-hub client settings`.

use super::hub::HubOptions;
use crate::output::{Failure, print, print_as, write_file};
use dashboard::settings_file::{self, SettingsFile};
use motor_hub::extension::HubFunction;
use motor_hub::extension::state::StoreReport;
use motor_hub::store::{Outcome, Stored};
use motor_hub_client::Session;
use motor_hub_client::reasons::{stored_text, why_unsaved};
use serde_json::json;
use simulated::scenario::read_text;
use std::path::{Path, PathBuf};
use studies::table;

/// Shows, saves, loads, resets, exports or imports stored settings, on hubs of this project
///
/// Other commands (setup, coefficients, identify --apply, drive, settings import) change settings until the next
/// reset; `save` stores them permanently.
///
/// Stored for each motor: set-up, motion, protection, current limit, bridge timing, mode, current alert, and
/// coefficients that a host has set. Stored for the hub: its drive base, as `drive` has configured it, and its
/// address, which set-address saves without `save`.
///
/// After a power cut during a save either the old or the new settings are complete. Some saves erase flash, for which
/// all motors must be disabled; this program disables them.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(subcommand)]
    command: Command,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Shows what is stored, and whether it differs from the settings in force
    Show {
        /// JSON instead of a table
        #[arg(long)]
        json: bool,
    },
    /// Stores the settings in force
    Save,
    /// Puts the stored settings in force, except the address
    Load,
    /// Puts the firmware's defaults in force and stores them; the address becomes the default at the next reset
    Reset,
    /// Writes the settings in force as TOML to a file, or to standard output without a file or with -
    Export {
        #[arg(value_name = "FILE")]
        file: Option<PathBuf>,
    },
    /// Puts all settings of a file in force, or none if the hub refuses one; the address is not changed
    Import {
        #[arg(value_name = "FILE")]
        file: PathBuf,
        /// Also stores them
        #[arg(long)]
        save: bool,
    },
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let imported = match &self.command {
            Command::Import { file, .. } => read(file)?,
            Command::Export { file: Some(file) }
                if file.extension().is_some_and(|end| end.eq_ignore_ascii_case("json")) =>
            {
                let why = "settings are exported as TOML; give a name that ends in .toml, or read single motors by `client setup MOTOR --json`";
                return Err(Failure::Input(format!("{}: {why}", file.display())));
            }
            _ => SettingsFile::default(),
        };
        let session = &mut hub.open(None)?;
        let done = match self.command {
            Command::Show { json } => return show(&session.stored()?, json),
            Command::Save => saved(session)?,
            Command::Load => {
                let report = session.store(HubFunction::Load)?;
                ended(&report)?;
                format!("the stored settings are in force: {}", stored_text(&report))
            }
            Command::Reset => {
                ended(&session.store(HubFunction::Reset)?)?;
                "the firmware's defaults are in force and stored".to_owned()
            }
            Command::Export { file } => {
                // Only the report of the stored settings says which coefficients a host has set. A hub without this
                // report is refused, because the file would lack these coefficients.
                if session.stored_if_reported()?.is_none() {
                    return Err(Failure::work(
                        "export needs a hub that stores settings, because other hubs do not report which coefficients a host has set; \
                         start a simulated hub with `serve --store FILE`",
                    ));
                }
                let text = settings_file::export(session)?;
                not_reset(session)?;
                let Some(file) = file.filter(|file| file != Path::new("-")) else { return print(&text) };
                write_file(&file, text.as_bytes())?;
                format!("wrote {}", file.display())
            }
            Command::Import { file, save } => {
                session
                    .apply_settings(imported.motors, imported.base)
                    .map_err(|error| Failure::Work(format!("{}: {error}", file.display())))?;
                let in_force = format!("the settings of {} are in force", file.display());
                if save {
                    // The settings stay in force if the hub refuses to store them.
                    print(&format!("{in_force}\n"))?;
                    saved(session)?
                } else {
                    in_force
                }
            }
        };
        print(&format!("{done}\n"))
    }
}

/// Fails if the hub was reset since the session was opened, because settings that were not stored are then lost.
pub(super) fn not_reset(session: &mut Session) -> Result<(), Failure> {
    session.report()?;
    let why = "the hub was reset meanwhile, and settings that were not stored are lost: repeat the command";
    if session.resets() == 0 { Ok(()) } else { Err(Failure::work(why)) }
}

/// Stores the settings in force. Returns the text for the user.
pub(super) fn saved(session: &mut Session) -> Result<String, Failure> {
    let report = session.store(HubFunction::Save)?;
    ended(&report)?;
    not_reset(session)?;
    Ok(format!("stored: {}", stored_text(&report)))
}

/// Reads the settings in a file.
fn read(file: &Path) -> Result<SettingsFile, Failure> {
    let text = read_text(file).map_err(|error| Failure::Input(format!("{}: {error}", file.display())))?;
    settings_file::read(&text)
        .map_err(|error| Failure::Input(format!("{}: {}", file.display(), error.trim_end())))
}

/// Fails if a save, load or reset that the hub has accepted has not succeeded.
fn ended(report: &StoreReport) -> Result<(), Failure> {
    why_unsaved(report).map_or(Ok(()), |why| Err(Failure::work(why)))
}

fn show(report: &StoreReport, json: bool) -> Result<(), Failure> {
    let StoreReport { stored, version, number, is_busy, outcome, differs, unknown, refused, .. } = *report;
    let document = json!({
        "stored": stored,
        "version": version,
        "number": number,
        "busy": is_busy,
        "outcome": Some(outcome).filter(|outcome| *outcome != Outcome::None),
        "differs": differs,
        "unknown_entries": unknown,
        "refused_entries": refused,
    });
    let mut table = table::new(&["stored", &stored_text(report)], 1);
    let in_force = match stored {
        _ if differs => "other settings, until the next reset",
        Stored::Whole | Stored::OneCopy => "the stored settings",
        Stored::Nothing | Stored::Later | Stored::Damaged => "the firmware's defaults",
    };
    table.add_row(["in force", in_force]);
    if unknown > 0 {
        table.add_row(["of another firmware", &format!("{unknown} entries, kept")]);
    }
    if refused > 0 {
        table.add_row([
            "out of range",
            &format!("{refused} entries; the firmware's defaults are in force instead"),
        ]);
    }
    let has_result = is_busy || outcome != Outcome::None;
    if let Some(why) = why_unsaved(report).filter(|_| has_result) {
        table.add_row(["last result", why]);
    }
    print_as(json, &document, table)
}
