//! Implements the command `motor-hub client identify`.

use super::drive::INTERVAL;
use super::hub::HubOptions;
use super::motors_off::DrivingSession;
use super::readings::{Live, repeat};
use super::settings::not_reset;
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
fn wrong_type(configured: Option<&(Motor, Dynamics)>, found: &Identified) -> Option<String> {
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

/// Returns why a motor was not identified, and for too little travel how much is needed.
fn reason(outcome: Identification, of: &MotorSettings, battery: Millivolts) -> String {
    let words = words(outcome);
    if outcome == Identification::Refused(Refusal::TravelLimit) {
        // A hub does not report its control period, which is 50 ms unless its image was built for another one.
        let counts = least_travel(of.motor.winding.emf, battery, Period::DEFAULT);
        // 5 % more, because the battery voltage may be higher at the next attempt.
        return format!("{words}, at least {} counts (--travel-counts)", counts + counts / 20);
    }
    words
}

/// An identification that has ended, and its comparison with the catalogue.
pub(super) struct Ended {
    /// Result as JSON.
    pub(super) document: Value,
    /// Result as a table, beside the motor of the catalogue; empty if the motor was not identified.
    pub(super) table: String,
    /// Share of the changes of speed that the result does not explain, in percent; 0 if the motor was not identified.
    residual_percent: f64,
    /// Proposed settings, or why the motor was not identified.
    pub(super) proposed: Result<MotorSettings, String>,
    /// Name of the configured motor of the catalogue; `None` for other constants.
    pub(super) name: Option<&'static str>,
    /// Inertia of the motor with its load, in inertias of the bare motor of the catalogue.
    pub(super) inertia_ratio: Option<f64>,
}

impl Ended {
    /// Identifies a motor with these settings, and disables the motor. `travel` limits the motion in counts in either
    /// direction. Prints the progress if `shows_progress` is true. Prints a warning if the motor is probably of another
    /// type.
    pub(super) fn run(
        session: &mut Session,
        motor: u8,
        before: &MotorSettings,
        travel: u32,
        shows_progress: bool,
    ) -> Result<Self, Failure> {
        let battery = session.battery()?;
        let outcome = identify(session, motor, travel, shows_progress)?;
        let catalogue = catalogue_motor(&before.motor);
        let name = catalogue.as_ref().map(|(motor, _)| motor.name);
        let (mut inertia, mut warning, mut table, mut residual_percent) = (None, None, String::new(), 0.0);
        let mut proposed =
            Err(format!("motor {motor} was not identified: {}", reason(outcome, before, battery)));
        if let Identification::Found(found) = &outcome {
            inertia = catalogue.as_ref().map(|(_, bare)| inertia_ratio(bare, &found.dynamics));
            warning = wrong_type(catalogue.as_ref(), found);
            let beside = catalogue.as_ref().map(|(motor, bare)| (motor.name, bare));
            table = format!("{}\n", found_table(&format!("motor {motor}"), found, beside));
            residual_percent = f64::from(found.residual) / 10.0;
            proposed = Ok(proposal(before, &found.dynamics, battery));
        }
        if let Some(why) = &warning {
            print_error_line(&format!("warning: {why}"));
        }
        let more = json!({
            "motor": motor, "catalogue": name, "inertia_to_bare_motor": inertia, "warning": warning,
        });
        let document = with_fields(identify::json(outcome), more);
        Ok(Self { document, table, residual_percent, proposed, name, inertia_ratio: inertia })
    }
}

impl Options {
    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        let session = &mut hub.open(self.motor.hub)?;
        let motor = self.motor.number;
        let before = session.settings(motor)?;
        let ended = Ended::run(session, motor, &before, self.travel, !self.json)?;
        if let Ok(proposed) = &ended.proposed
            && self.apply
        {
            apply(session, motor, proposed)?;
        }
        if self.json {
            let proposed = ended.proposed.as_ref().ok();
            let more = json!({
                "now": motion_json(&before),
                "proposed": proposed.map(motion_json),
                "applied": self.apply && proposed.is_some(),
            });
            print_json(&with_fields(ended.document, more))?;
        } else if let Ok(proposed) = &ended.proposed {
            print(&self.text(&ended, &before, proposed))?;
        }
        ended.proposed.map(drop).map_err(Failure::Work)
    }

    fn text(&self, ended: &Ended, before: &MotorSettings, after: &MotorSettings) -> String {
        let load = match ended.name.zip(ended.inertia_ratio) {
            Some((name, ratio)) => {
                format!("With its load it has {ratio:.2} times the inertia of a bare {name}\n")
            }
            None => "The catalogue has no motor with the configured constants\n".to_owned(),
        };
        let mut settings = table::new(&["setting", "now", "proposed"], 1);
        for ((name, now), (_, proposed)) in rows(before).into_iter().zip(rows(after)) {
            settings.add_row([name, &now, &proposed]);
        }
        let end = if self.apply {
            "Applied: until its reset the hub regulates the motor by this result"
        } else {
            "Not applied; --apply puts the proposed settings in force"
        };
        format!(
            "{}Residual: {:.1} % of the changes of speed are not explained\n{load}\n{settings}\n{end}\n",
            ended.table, ended.residual_percent
        )
    }
}

/// Puts the settings of a motor in force. Fails if a reset of the hub has deleted settings.
pub(super) fn apply(session: &mut Session, motor: u8, settings: &MotorSettings) -> Result<(), Failure> {
    not_reset(session)?;
    session.set_up(motor, settings)?;
    not_reset(session)
}

/// Moves a motor until its identification has ended, and disables the motor.
fn identify(
    session: &mut Session,
    motor: u8,
    travel: u32,
    shows_progress: bool,
) -> Result<Identification, Failure> {
    let show = |text: &str| if shows_progress { print(text) } else { Ok(()) };
    let mut live = Live::new();
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
                Progress::Turning(percent) if shows_progress => {
                    let progress = format!("{percent} %\n");
                    live.show(|| progress.clone(), &progress)?;
                }
                Progress::Turning(_) => (),
                Progress::Ended(Identification::None) => {
                    return Err(Failure::Work(format!(
                        "motor {motor} was not identified: the hub was reset, and settings that were not stored are lost"
                    )));
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
