//! `motor-hub client tune`.

use super::identify;
use super::trouble::Trouble;
use crate::output::{Failure, print, print_json};
use motor_hub::extension::settings::MotorSettings;
use motor_hub::model::catalogue::{Motor, motors};
use motor_hub::model::load::Load;
use motor_hub::motor::Settings;
use motor_hub::regulator::Dynamics;
use motor_hub::regulator::identify::{Identification, Identified};
use motor_hub::units::{Acceleration, Millivolts};
use motor_hub_client::Session;
use motor_hub_client::line::Line;
use serde_json::{Value, json};
use simulated::hardware::{BRIDGE, mechanics, winding};
use studies::identify::{found_table, json as found_json, words};
use studies::table;

/// Text of the long help.
pub(super) const HELP: &str = "\
Identifies a motor with its load, compares it with the catalogue, and proposes settings, on hubs of this project

Configure the motor first, for example by `setup 0 --type \"NeveRest 60\"`: the result depends on its winding. The motor must \
stand, and be free to turn.

Proposed are the identified motion, and a largest acceleration of half of what the battery gives the motor at rest. The motor \
can reach that acceleration up to half of its free speed, so it does not lag behind its set-point. With --apply the settings \
are in force until the hub's reset.";

/// Options of `identify`.
#[derive(clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    identify: identify::Options,
}

/// Proposed acceleration, as a share of the acceleration that the battery gives a motor at rest.
const SHARE: f64 = 0.5;

impl Options {
    pub(super) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let motor = self.identify.motor;
        let (before, battery) = (session.settings(motor)?, session.battery()?);
        let outcome = self.identify.learned(session)?;
        let Identification::Found(found) = outcome else {
            return Err(Failure::Work(format!("motor {motor} was not identified: {}", words(outcome))).into());
        };
        let proposed = proposal(&before, &found.dynamics, battery);
        if self.identify.apply {
            identify::apply(session, motor, &proposed)?;
        }
        let catalogue = catalogue_motor(&before.motor);
        if self.identify.json {
            return Ok(print_json(&self.document(&found, catalogue.as_ref(), &before, &proposed))?);
        }
        Ok(print(&self.text(&found, catalogue.as_ref(), &before, &proposed))?)
    }

    fn text(
        &self,
        found: &Identified,
        bare: Option<&(Motor, Dynamics)>,
        before: &MotorSettings,
        after: &MotorSettings,
    ) -> String {
        let beside = bare.map(|(motor, dynamics)| (motor.name, dynamics));
        let learned = found_table(&format!("motor {}", self.identify.motor), found, beside);
        let load = match bare {
            Some((motor, dynamics)) => format!(
                "With its load it has {:.2} times the inertia of a bare {}\n",
                inertia(dynamics, &found.dynamics),
                motor.name
            ),
            None => "The catalogue has no motor with the configured constants\n".to_owned(),
        };
        let mut settings = table::new(&["setting", "now", "proposed"], 1);
        for ((name, now), (_, proposed)) in rows(before).into_iter().zip(rows(after)) {
            settings.add_row([name, &now, &proposed]);
        }
        let end = if self.identify.apply {
            "Applied: the proposed settings are in force until the hub's reset"
        } else {
            "Not applied; --apply puts the proposed settings in force"
        };
        format!("{learned}\n{load}\n{settings}\n{end}\n")
    }

    fn document(
        &self,
        found: &Identified,
        bare: Option<&(Motor, Dynamics)>,
        before: &MotorSettings,
        after: &MotorSettings,
    ) -> Value {
        let mut document = found_json(Identification::Found(*found));
        if let Some(object) = document.as_object_mut() {
            object.insert("motor".into(), json!(self.identify.motor));
            object.insert("catalogue".into(), json!(bare.map(|(motor, _)| motor.name)));
            let times = bare.map(|(_, dynamics)| inertia(dynamics, &found.dynamics));
            object.insert("inertia_to_bare_motor".into(), json!(times));
            object.insert("now".into(), motion_json(before));
            object.insert("proposed".into(), motion_json(after));
            object.insert("applied".into(), json!(self.identify.apply));
        }
        document
    }
}

/// The settings proposed for a motor with these dynamics.
fn proposal(before: &MotorSettings, dynamics: &Dynamics, battery: Millivolts) -> MotorSettings {
    let volts = f64::from(battery.get().saturating_sub(dynamics.friction.get())) / 1e3;
    let limit = SHARE * volts * f64::from(dynamics.gain.to_f32());
    let acceleration = Acceleration::new(limit.round().max(1.0) as u32).ok();
    let motor = Settings { dynamics: Some(*dynamics), acceleration, ..before.motor };
    MotorSettings { motor, ..*before }
}

/// The configured motor of the catalogue, and its dynamics without a load.
fn catalogue_motor(settings: &Settings) -> Option<(Motor, Dynamics)> {
    let (motor, winding) = motors().find_map(|motor| {
        let winding = winding(&motor).ok()?;
        (winding == settings.winding).then_some((motor, winding))
    })?;
    let bare = motor.with_measured_rotor_inertia();
    Some((motor, Dynamics::from_mechanics(&winding, &BRIDGE, &mechanics(&bare, &Load::NONE)).ok()?))
}

/// Inertia with load, divided by the inertia of the bare motor: the inverse ratio of their accelerations per volt.
fn inertia(bare: &Dynamics, found: &Dynamics) -> f64 {
    f64::from(bare.gain.to_f32()) / f64::from(found.gain.to_f32())
}

/// A motion as rows of a table.
pub(super) fn rows(of: &MotorSettings) -> [(&'static str, String); 4] {
    let known = |value: Option<String>| value.unwrap_or_else(|| "not configured".to_owned());
    let Settings { dynamics, acceleration, .. } = of.motor;
    [
        ("acceleration per volt, counts/s²/V", known(dynamics.map(|d| format!("{:.1}", d.gain.to_f32())))),
        ("decay, 1/s", known(dynamics.map(|d| format!("{:.3}", d.decay.to_f32())))),
        ("friction, V", known(dynamics.map(|d| format!("{:.3}", f64::from(d.friction.get()) / 1e3)))),
        (
            "largest acceleration, counts/s²",
            acceleration.map_or_else(|| "no limit".to_owned(), |limit| limit.get().to_string()),
        ),
    ]
}

/// A motion as JSON.
pub(super) fn motion_json(of: &MotorSettings) -> Value {
    let Settings { dynamics, acceleration, .. } = of.motor;
    json!({
        "acceleration_per_volt": dynamics.map(|d| d.gain.to_f32()),
        "decay_per_s": dynamics.map(|d| d.decay.to_f32()),
        "friction_v": dynamics.map(|d| f64::from(d.friction.get()) / 1e3),
        "acceleration_cps2": acceleration.map(Acceleration::get),
    })
}
