//! Implements the command `motor-hub client tune`.

use super::hub::HubOptions;
use super::identify::{self, Ended};
use super::{settings, setup};
use crate::output::{Failure, print, print_error_line, print_json};
use crate::parse::{MotorName, motor, whole};
use motor_hub::braking::Winding;
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::motor::Settings;
use serde_json::json;
use studies::{table, with_fields};

/// Configures a new motor: sets it up, identifies it, applies and stores the result, on hubs of this project
///
/// One command in place of `setup 0 --type NAME`, `identify 0 --apply` and `settings save`. The motor must stand, and
/// be free to turn with its load. The motion takes some 3 s. The motor is disabled at the end, on Ctrl-C, and on any
/// error.
///
/// Unlike `identify --apply`, this command sets no acceleration limit, so the motor accelerates as fast as the battery
/// permits. --gentle sets the limit that `identify` proposes. Without --save the settings are in force until the hub's
/// reset.
///
/// If the motor is not identified, for example because a constant load pulls at the motor, its set-up stays in force.
/// The hub then learns the acceleration per volt while the motor works, unless earlier constants or coefficients are
/// still in force. Nothing is stored, and the exit code is 1.
///
/// A warning on standard error says if the result is implausible for the configured motor. The exit code stays 0.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Motor 0 to 3
    #[arg(value_parser = motor)]
    pub(super) motor: MotorName,
    /// Connected motor by its name in the catalogue, such as "NeveRest 60" [default: the configured motor]
    #[arg(long = "type", value_name = "NAME", value_parser = characterised)]
    motor_type: Option<Motor>,
    /// Longest travel either way, in counts; a small limit makes the motion shorter [default: no limit]
    #[arg(long = "travel-counts", value_name = "COUNTS", default_value_t = u32::MAX)]
    #[arg(hide_default_value = true, value_parser = whole("a travel", 0..=u32::MAX, "counts"))]
    travel: u32,
    /// Limits the acceleration to half of what the battery gives the motor at rest
    #[arg(long)]
    gentle: bool,
    /// Stores the settings of the hub permanently
    #[arg(long)]
    save: bool,
    /// JSON instead of text
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let session = &mut hub.open(self.motor.hub)?;
        let number = self.motor.number;
        if let Some(motor) = &self.motor_type {
            setup::write_type(session, number, motor)?;
        }
        let before = session.settings(number)?;
        if self.motor_type.is_none()
            && before.motor.winding == Winding::NEVEREST_60
            && before.motor.thermal.is_none()
        {
            print_error_line("note: no --type given, and a hub that was never set up assumes a NeveRest 60");
        }
        let ended = Ended::run(session, number, &before, self.travel, !self.json)?;
        let (mut tuned, mut saved) = (before, Ok(false));
        if let Ok(proposed) = &ended.proposed {
            tuned = *proposed;
            if !self.gentle {
                tuned.motor.acceleration = None;
            }
            identify::apply(session, number, &tuned)?;
            if self.save {
                saved = settings::saved(session).map(|_| true);
            }
        }
        let is_saved = matches!(saved, Ok(true));
        if self.json {
            let more = json!({ "motion": identify::motion_json(&tuned), "saved": is_saved });
            print_json(&with_fields(ended.document, more))?;
        } else {
            let mut table = table::new(&["motor", &number.to_string()], 1);
            table.add_row(["motor of the catalogue", ended.name.unwrap_or("none with these constants")]);
            if let Some(times) = ended.inertia_ratio {
                table.add_row(["inertia, of that of the bare motor", &format!("{times:.2}")]);
            }
            for (name, value) in identify::rows(&tuned) {
                table.add_row([name, &value]);
            }
            table.add_row(["settings", if is_saved { "stored" } else { "in force until the hub's reset" }]);
            print(&format!("{}{table}\n", ended.table))?;
        }
        saved?;
        let failed = |why| Failure::Work(format!("{why}; {}", in_force(&before.motor)));
        ended.proposed.map(drop).map_err(failed)
    }
}

/// Returns what a motor that was not identified is regulated by.
const fn in_force(settings: &Settings) -> &'static str {
    match settings {
        Settings { coefficients: Some(_), .. } => "the coefficients that a host has set stay in force",
        Settings { dynamics: Some(_), .. } => {
            "acceleration per volt, decay and friction that were configured before stay in force"
        }
        _ => "its set-up is in force, and the hub learns while the motor works",
    }
}
