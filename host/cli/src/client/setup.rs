//! `motor-hub client setup`.

use super::trouble::Trouble;
use crate::choice::Choice;
use crate::output::{Failure, print, print_json};
use crate::parse::channel;
use motor_hub::braking::DutyRule;
use motor_hub::model::catalogue::characterised;
use motor_hub::protocol::setup::Setup;
use motor_hub_client::Session;
use motor_hub_client::line::Line;
use serde_json::json;
use simulated::hardware::winding;
use simulated::scheme::describe;
use studies::table;

/// Of which motor, and what to change.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Motor 0 to 3
    #[arg(value_parser = channel)]
    motor: u8,
    /// What is connected: a motor of the catalogue
    #[arg(long = "type", value_name = "NAME")]
    name: Option<String>,
    #[command(flatten)]
    choice: Choice,
    /// JSON instead of a table
    #[arg(long)]
    json: bool,
}

impl Options {
    pub(crate) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let changes = self.name.is_some() || !self.choice.is_empty();
        let mut setup = session.setup(self.motor)?;
        if changes {
            session.set_up(self.motor, self.change(setup)?)?;
            setup = session.setup(self.motor)?;
        }
        self.show(setup)
    }

    fn change(&self, mut setup: Setup) -> Result<Setup, Failure> {
        if let Some(name) = &self.name {
            let motor = characterised(name).map_err(Failure::input)?;
            let winding = winding(&motor).map_err(Failure::input)?;
            setup.emf = winding.emf;
            setup.resistance = Some(winding.resistance);
            setup.inductance = winding.inductance;
        }
        if let Some(scheme) = self.choice.scheme().map_err(Failure::input)? {
            setup.scheme = scheme;
        }
        if let Some(duty) = self.choice.duty() {
            setup.duty = duty;
        }
        if setup.duty == DutyRule::LinearCurrent && setup.resistance.is_none() {
            let why = "linear current needs the motor's resistance: name the motor by --type";
            return Err(Failure::input(why));
        }
        Ok(setup)
    }

    fn show(&self, setup: Setup) -> Result<(), Trouble> {
        let Setup { emf, resistance, inductance, scheme, duty } = setup;
        let emf = f64::from(emf.to_bits()) / f64::from(1 << 20);
        let ohms = resistance.map(|resistance| f64::from(resistance.as_milliohms()) / 1e3);
        let millihenries = inductance.map(|inductance| f64::from(inductance.as_microhenries()) / 1e3);
        let duty = match duty {
            DutyRule::LinearCurrent => "linear current",
            DutyRule::LinearDuty => "linear duty",
        };
        if self.json {
            let document = json!({
                "motor": self.motor,
                "emf_mv_s_per_count": emf,
                "resistance_ohm": ohms.unwrap_or(0.0),
                "inductance_mh": millihenries.unwrap_or(0.0),
                "scheme": describe(scheme),
                "duty": duty,
            });
            return Ok(print_json(&document)?);
        }
        let known = |value: Option<f64>, unit: &str| {
            value.map_or_else(|| "unknown".to_owned(), |value| format!("{value:.3} {unit}"))
        };
        let mut table = table::new(&["motor", &self.motor.to_string()], 2);
        table
            .add_row(["back EMF", &format!("{emf:.4} mV s/count")])
            .add_row(["resistance", &known(ohms, "ohm")])
            .add_row(["inductance", &known(millihenries, "mH")])
            .add_row(["scheme", &describe(scheme)])
            .add_row(["duty", duty]);
        Ok(print(&format!("{table}\n"))?)
    }
}
