//! Implements the command `motor-hub client identify`.

use super::drive::{INTERVAL, READINGS_PER_LINE};
use super::hub::HubOptions;
use super::motors_off::DrivingSession;
use super::readings::{Live, repeat};
use crate::output::{Failure, print, print_error_line, print_json};
use crate::parse::{MotorName, motor, whole};
use dashboard::proposal::{catalogue_motor, inertia_ratio, proposal};
use motor_hub::extension::settings::MotorSettings;
use motor_hub::model::catalogue::Motor;
use motor_hub::motor::Settings;
use motor_hub::regulator::Dynamics;
use motor_hub::regulator::identify::{Identification, Identified, Refusal, least_travel};
use motor_hub::units::{Acceleration, Millivolts, Period};
use motor_hub_client::Session;
use motor_hub_client::identification::{Identifying, Progress};
use serde_json::{Value, json};
use std::time::Duration;
use studies::identify::{self, found_table, words};
use studies::{table, with_fields};

/// Time-out of an identification. The slowest motor needs half of this time.
const LONGEST: Duration = Duration::from_secs(30);

/// Identifies a motor, compares it with the catalogue, and proposes settings, on hubs of this project
///
/// Configure the motor first, for example by `setup 0 --type "NeveRest 60"`: the result depends on its winding. The
/// motor must stand, and be free to turn. The motion takes some 3 s. The motor is disabled at the end, on Ctrl-C, and
/// on any error.
///
/// The command proposes the identified motion and an acceleration limit. The limit is half of the acceleration that
/// the battery can give the motor at rest. The motor can reach the limit up to half of its free speed, so it does not
/// lag behind its set-point. With --apply the settings are in force until the hub's reset. The hub then deletes
/// coefficients that a host has set.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Motor 0 to 3
    #[arg(value_parser = motor)]
    motor: MotorName,
    /// Longest travel either way, in counts; a small limit makes the motion shorter [default: no limit]
    #[arg(long = "travel-counts", alias = "travel", value_name = "COUNTS", default_value_t = u32::MAX)]
    #[arg(hide_default_value = true, value_parser = whole("a travel", 0..=u32::MAX, "counts"))]
    travel: u32,
    /// Applies the proposed settings until the hub's reset
    #[arg(long)]
    apply: bool,
    /// JSON instead of tables
    #[arg(long)]
    json: bool,
}

/// Inertia of a motor with its load, in inertias of the bare motor, below which the motor is probably of another type.
/// Measured bare motors have at least 0.76 times the inertia of the motor of the catalogue with the name under which
/// they are sold (a NeveRest 20-B).
const LEAST_INERTIA: f64 = 0.7;
/// Back EMF with drag, divided by that of the motor of the catalogue, above which the motor is probably of another type.
/// Of the 17 measured motors, 15 have at most 1.2 times the value of the name under which they are sold. Two NeveRest 40
/// with much drag have 2.0 and 5.1 times this value.
const LARGEST_EMF: f64 = 1.5;

/// Returns why a motor is probably not the configured motor of the catalogue; `None` if it may be this motor.
pub(super) fn wrong_type(configured: Option<&(Motor, Dynamics)>, found: &Identified) -> Option<String> {
    let (motor, bare) = configured?;
    let inertia = inertia_ratio(bare, &found.dynamics);
    let emf = found.emf.to_millivolt_seconds() * f64::from(bare.gain.to_f32())
        / (1e3 * f64::from(bare.decay.to_f32()));
    let why = if inertia < LEAST_INERTIA {
        format!("the motor with its load has {inertia:.2} times the inertia of the bare one")
    } else if !found.emf_is_configured && emf > LARGEST_EMF {
        format!("back EMF and drag are {emf:.1} times those of the catalogue, unless the motor drags much")
    } else {
        return None;
    };
    Some(format!("probably not a {}: {why}; give the right --type to `setup` or `tune`", motor.name))
}

/// Prints a warning on standard error.
pub(super) fn warn_of(why: Option<&str>) {
    if let Some(why) = why {
        print_error_line(&format!("warning: {why}"));
    }
}

/// Returns why a motor was not identified, and for too little travel how much is needed.
pub(super) fn reason(outcome: Identification, of: &MotorSettings, battery: Millivolts) -> String {
    let words = words(outcome);
    if outcome == Identification::Refused(Refusal::TravelLimit) {
        // A hub does not report its control period, which is 50 ms unless its image was built for another one.
        let counts = least_travel(of.motor.winding.emf, battery, Period::DEFAULT);
        // 5 % more, because the battery voltage may be higher at the next attempt.
        return format!("{words}, at least {} counts (--travel-counts)", counts + counts / 20);
    }
    words
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let session = &mut hub.open(self.motor.hub)?;
        let motor = self.motor.number;
        let (before, battery) = (session.settings(motor)?, session.battery()?);
        let outcome = identify(session, motor, self.travel, !self.json)?;
        let Identification::Found(found) = outcome else {
            if self.json {
                let more = json!({ "motor": motor, "applied": false });
                print_json(&with_fields(identify::json(outcome), more))?;
            }
            let why = reason(outcome, &before, battery);
            return Err(Failure::Work(format!("motor {motor} was not identified: {why}")));
        };
        let proposed = proposal(&before, &found.dynamics, battery);
        if self.apply {
            session.set_up(motor, &proposed)?;
        }
        let catalogue = catalogue_motor(&before.motor);
        let bare = catalogue.as_ref();
        let warning = wrong_type(bare, &found);
        warn_of(warning.as_deref());
        if !self.json {
            return print(&self.text(&found, bare, &before, &proposed));
        }
        let more = json!({
            "motor": motor,
            "catalogue": bare.map(|(motor, _)| motor.name),
            "inertia_to_bare_motor": bare.map(|(_, dynamics)| inertia_ratio(dynamics, &found.dynamics)),
            "warning": warning,
            "now": motion_json(&before),
            "proposed": motion_json(&proposed),
            "applied": self.apply,
        });
        print_json(&with_fields(identify::json(outcome), more))
    }

    fn text(
        &self,
        found: &Identified,
        bare: Option<&(Motor, Dynamics)>,
        before: &MotorSettings,
        after: &MotorSettings,
    ) -> String {
        let beside = bare.map(|(motor, dynamics)| (motor.name, dynamics));
        let learned = found_table(&format!("motor {}", self.motor.number), found, beside);
        let load = match bare {
            Some((motor, dynamics)) => format!(
                "With its load it has {:.2} times the inertia of a bare {}\n",
                inertia_ratio(dynamics, &found.dynamics),
                motor.name
            ),
            None => "The catalogue has no motor with the configured constants\n".to_owned(),
        };
        let mut settings = table::new(&["setting", "now", "proposed"], 1);
        for ((name, now), (_, proposed)) in rows(before).into_iter().zip(rows(after)) {
            settings.add_row([name, &now, &proposed]);
        }
        let residual = f64::from(found.residual) / 10.0;
        let end = if self.apply {
            "Applied: until its reset the hub regulates the motor by this result"
        } else {
            "Not applied; --apply puts the proposed settings in force"
        };
        format!(
            "{learned}\nResidual: {residual:.1} % of the changes of speed are not explained\n{load}\n{settings}\n{end}\n"
        )
    }
}

/// Identifies a motor, and disables the motor. `travel` limits the motion in counts in either direction. Prints the
/// progress if `shows_progress` is true.
pub(super) fn identify(
    session: &mut Session,
    motor: u8,
    travel: u32,
    shows_progress: bool,
) -> Result<Identification, Failure> {
    let show = |text: &str| if shows_progress { print(text) } else { Ok(()) };
    let mut live = Live::new();
    let mut readings = 0u32;
    let mut ended = None;
    DrivingSession::run(session, |driven| {
        let mut identifying = Identifying::begin(driven, motor, travel)?;
        driven.enable(motor)?;
        repeat(INTERVAL, Some(LONGEST), |_| {
            match identifying.step(driven)? {
                Progress::Braking => (),
                Progress::Started(travel) => {
                    show(&format!(
                        "motor {motor}: turns at most {travel} counts either way, for some 3 s\n"
                    ))?;
                }
                Progress::Turning(percent) => {
                    let progress = format!("{percent} %\n");
                    readings += 1;
                    if live.terminal && shows_progress {
                        live.redraw(&progress)?;
                    } else if readings.is_multiple_of(READINGS_PER_LINE) {
                        show(&progress)?;
                    }
                }
                Progress::Ended(outcome) => ended = Some(outcome),
            }
            Ok(ended.is_some())
        })?;
        ended.ok_or_else(|| {
            let seconds = LONGEST.as_secs();
            Failure::Work(format!("motor {motor} was not identified within {seconds} s"))
        })
    })
}

/// Returns the dynamics and the acceleration limit of a motor as rows of a table.
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

/// Returns the dynamics and the acceleration limit of a motor as JSON.
pub(super) fn motion_json(of: &MotorSettings) -> Value {
    let Settings { dynamics, acceleration, .. } = of.motor;
    json!({
        "acceleration_per_volt": dynamics.map(|d| d.gain.to_f32()),
        "decay_per_s": dynamics.map(|d| d.decay.to_f32()),
        "friction_v": dynamics.map(|d| f64::from(d.friction.get()) / 1e3),
        "acceleration_cps2": acceleration.map(Acceleration::get),
    })
}
