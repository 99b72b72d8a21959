//! Implements the command `motor-hub client setup`.

use super::hub::HubOptions;
use super::identify;
use super::setting_options::{SettingOption, SettingOptions};
use super::settings::not_reset;
use super::status::state_text;
use crate::constants::Constants;
use crate::output::{Failure, print_as};
use crate::parse::{MotorName, motor, named};
use crate::scheme_options::SchemeOptions;
use motor_hub::braking::Winding;
use motor_hub::bridge::Timing;
use motor_hub::extension::report::Condition;
use motor_hub::extension::settings::{Field, Group, MotorSettings, Values};
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::motor::{Settings, ThermalLimit};
use motor_hub::units::EmfConstant;
use motor_hub_client::Session;
use serde_json::json;
use simulated::hardware::{thermal_limit, winding};
use simulated::scheme::{SchemeWords, describe};
use studies::table;

/// Shows or configures the connected motor and its control, on hubs of this project
///
/// A change of motor, constants, scheme or duty also resets coefficients and motion to that motor's defaults. Settings
/// are lost at a reset unless they are saved: see `settings`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Motor 0 to 3
    #[arg(value_parser = motor)]
    motor: MotorName,
    /// Connected motor by its name in the catalogue, such as "NeveRest 60"; see `motor-hub motors`
    #[arg(long = "type", value_name = "NAME", conflicts_with_all = ["ke", "resistance_ohm", "inductance_mh"])]
    #[arg(value_parser = characterised)]
    motor_type: Option<Motor>,
    #[command(flatten)]
    constants: Constants,
    #[command(flatten)]
    scheme: SchemeOptions,
    /// Timing of the motor's bridge, which limits its duties
    #[arg(long, value_name = "WORD", ignore_case = true, value_parser = named(BRIDGES))]
    bridge: Option<Timing>,
    #[command(flatten)]
    settings: SettingOptions,
    /// JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// Timings of bridges with their descriptions.
const BRIDGES: [(&str, &str, Timing); 2] = [
    ("ideal", "Switches without delay, with any duty", Timing::IDEAL),
    ("vnh5019", "Switches like a VNH5019", Timing::VNH5019),
];

/// Returns the winding and the thermal limit of a motor of the catalogue.
fn of_type(motor: &Motor) -> Result<(Winding, Option<ThermalLimit>), Failure> {
    let limit = thermal_limit(motor).map_err(Failure::input)?;
    Ok((winding(motor).map_err(Failure::input)?, Some(limit)))
}

/// Writes the settings that differ. If `set_up` is true, the set-up is written also if it does not differ, because the
/// hub then deletes motion and coefficients.
fn write(
    session: &mut Session,
    motor: u8,
    before: &MotorSettings,
    wanted: &MotorSettings,
    set_up: bool,
) -> Result<(), Failure> {
    for group in Group::without_coefficients() {
        let differs = Values::of(group, wanted) != Values::of(group, before);
        if differs || group == Group::SetUp && set_up {
            session.set(motor, group, wanted)?;
        }
    }
    Ok(())
}

/// Configures a motor as a motor of the catalogue.
pub(super) fn write_type(session: &mut Session, motor: u8, motor_type: &Motor) -> Result<(), Failure> {
    let before = session.settings(motor)?;
    let mut wanted = before;
    (wanted.motor.winding, wanted.motor.thermal) = of_type(motor_type)?;
    write(session, motor, &before, &wanted, true)
}

impl Options {
    /// Checks the options before anything is sent.
    fn check(&self) -> Result<(), Failure> {
        self.scheme.scheme()?;
        self.constants.emf().map(drop)
    }

    pub(super) fn execute(self, hub: &HubOptions) -> Result<(), Failure> {
        self.check()?;
        let session = &mut hub.open(self.motor.hub)?;
        let before = session.settings(self.motor.number)?;
        // All settings are checked before the first one is written.
        let wanted = self.changed(&before)?;
        // A set-up that the options give is written also if it changes nothing.
        let given = self.motor_type.is_some() || !self.scheme.is_empty() || !self.constants.is_empty();
        write(session, self.motor.number, &before, &wanted, given)?;
        let settings = session.settings(self.motor.number)?;
        session.catch_up()?;
        not_reset(session)?;
        self.show(&settings, session.condition(self.motor.number)?)
    }

    /// Returns the settings that the options request.
    fn changed(&self, before: &MotorSettings) -> Result<MotorSettings, Failure> {
        let mut settings = *before;
        let Settings { winding: constants, scheme, duty, thermal, bridge, .. } = &mut settings.motor;
        if let Some(motor) = &self.motor_type {
            (*constants, *thermal) = of_type(motor)?;
        }
        constants.emf = self.constants.emf()?.unwrap_or(constants.emf);
        constants.resistance = self.constants.resistance()?.unwrap_or(constants.resistance);
        constants.inductance = self.constants.inductance()?.or(constants.inductance);
        *scheme = self.scheme.scheme()?.unwrap_or(*scheme);
        *duty = self.scheme.duty.unwrap_or(*duty);
        if let Some(timing) = self.bridge {
            *bridge = bridge.with_timing(timing);
        }
        self.settings.apply_to(&mut settings)?;
        Ok(settings)
    }

    fn show(&self, settings: &MotorSettings, condition: Condition) -> Result<(), Failure> {
        let number = |name| Field::named(name).map_or(0.0, |field| field.number_of(field.get(settings)));
        let (emf, ohms) = (number("emf_mv_s_per_count"), number("resistance_ohm"));
        let in_force = condition.emf_constant.map(EmfConstant::to_millivolt_seconds);
        let millihenries = Some(number("inductance_mh")).filter(|mh| *mh != 0.0);
        let duty = Field::named("duty").and_then(|duty| duty.word_of(duty.get(settings))).unwrap_or_default();
        let Settings { scheme, bridge, .. } = settings.motor;
        let bridge = BRIDGES.iter().find(|(.., timing)| *timing == bridge.timing);
        let bridge = bridge.map_or("other", |(name, ..)| *name);
        let heat = settings.motor.thermal.map(|_| f64::from(condition.heat) / 10.0);
        let millivolt_seconds = |emf: f64| format!("{emf:.4} mV s/count");
        let words = json!(SchemeWords(scheme));
        let mut document = json!({
            "motor": self.motor.number,
            "emf_mv_s_per_count": emf,
            "emf_in_force_mv_s_per_count": in_force,
            "resistance_ohm": ohms,
            "inductance_mh": millihenries.unwrap_or(0.0),
            "scheme": words["scheme"],
            "blend": words["blend"],
            "duty": duty,
            "bridge": bridge,
            "heat_percent": heat,
            "derated": condition.derated,
            "overheated": condition.overheated,
            "bridge_fault": condition.bridge_fault,
            "measured_current_a": condition.measured_ma.map(|ma| f64::from(ma) / 1e3),
            "current_line": condition.sense_line,
            "motion": identify::motion_json(settings),
        });
        for option in SettingOption::all() {
            document[&option.key] = option.json(settings);
        }
        let inductance = millihenries.map_or_else(|| "not configured".to_owned(), |mh| format!("{mh:.3} mH"));
        let mut table = table::new(&["motor", &self.motor.number.to_string()], 2);
        table
            .add_row(["back EMF", &millivolt_seconds(emf)])
            .add_row([
                "back EMF in force",
                &in_force.map_or_else(|| "not reported".to_owned(), millivolt_seconds),
            ])
            .add_row(["resistance", &format!("{ohms:.3} ohm")])
            .add_row(["inductance", &inductance])
            .add_row(["scheme", &describe(scheme)])
            .add_row(["duty", &duty.replace('-', " ")])
            .add_row(["bridge", bridge])
            .add_row([
                "heat",
                &heat.map_or_else(
                    || "no thermal limit configured".to_owned(),
                    |heat| format!("{heat:.1} % of the thermal limit"),
                ),
            ])
            .add_row(["state", state_text(&condition)]);
        for option in SettingOption::all() {
            table.add_row([&option.label, &option.text(settings)]);
        }
        for (name, value) in identify::rows(settings) {
            table.add_row([name, &value]);
        }
        print_as(self.json, &document, table)
    }
}
