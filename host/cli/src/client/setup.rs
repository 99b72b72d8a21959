//! `motor-hub client setup`.

use super::trouble::Trouble;
use super::tune;
use crate::choice::Choice;
use crate::constants::Constants;
use crate::output::{Failure, print, print_json};
use crate::parse::channel;
use motor_hub::braking::DutyRule;
use motor_hub::bridge::Timing;
use motor_hub::model::catalogue::characterised;
use motor_hub::motor::{OnFault, SenseLine, ThermalLimit};
use motor_hub::protocol::setup::{Condition, Motion, Protection, Setup};
use motor_hub_client::Session;
use motor_hub_client::line::Line;
use serde_json::json;
use simulated::hardware::{thermal_limit, winding};
use simulated::scheme::{SchemeWords, describe};
use studies::table;

/// Motor, and settings to change.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Motor 0 to 3
    #[arg(value_parser = channel)]
    motor: u8,
    /// Connected motor by its name in the catalogue, such as "NeveRest 60"; see `motor-hub motors`
    #[arg(long = "type", value_name = "NAME", conflicts_with_all = ["ke", "resistance_ohm", "inductance_mh"])]
    name: Option<String>,
    #[command(flatten)]
    constants: Constants,
    #[command(flatten)]
    choice: Choice,
    /// Behaviour of the motor at a fault, and when its host is silent
    #[arg(long, value_name = "WORD", ignore_case = true)]
    on_fault: Option<OnFaultWord>,
    /// Timing of the motor's bridge, which limits its duties
    #[arg(long, value_name = "WORD", ignore_case = true)]
    bridge: Option<BridgeWord>,
    /// Current that the winding tolerates continuously; 0 for no limit [default with --type: a third of the stall current]
    #[arg(long = "continuous-current-a", alias = "continuous-current", value_name = "A", value_parser = continuous_ma)]
    continuous_current: Option<u16>,
    /// JSON instead of a table
    #[arg(long)]
    json: bool,
}

/// Amperes as milliamperes, 0 for none.
fn continuous_ma(text: &str) -> Result<u16, String> {
    let sound = |amperes: &f64| *amperes == 0.0 || (0.001..=65.535).contains(amperes);
    let amperes = text.parse().ok().filter(sound).map(|amperes| (1e3 * amperes).round() as u16);
    amperes.ok_or_else(|| "a continuous current is 0.001 to 65.535 A, or 0 for no limit".to_owned())
}

/// Behaviour at a fault, as a value of `--on-fault`.
#[derive(Clone, Copy, clap::ValueEnum)]
enum OnFaultWord {
    /// Opens the bridge
    Coast,
    /// Shorts the winding
    Brake,
}

/// Timing of a bridge, as a value of `--bridge`.
#[derive(Clone, Copy, clap::ValueEnum)]
enum BridgeWord {
    /// Switches without delay, with any duty
    Ideal,
    /// Switches like a VNH5019
    Vnh5019,
}

impl From<BridgeWord> for Timing {
    fn from(word: BridgeWord) -> Self {
        match word {
            BridgeWord::Ideal => Self::IDEAL,
            BridgeWord::Vnh5019 => Self::VNH5019,
        }
    }
}

impl From<OnFaultWord> for OnFault {
    fn from(word: OnFaultWord) -> Self {
        match word {
            OnFaultWord::Coast => Self::Coast,
            OnFaultWord::Brake => Self::Brake,
        }
    }
}

impl Options {
    /// Checks the options before anything is sent.
    pub(super) fn check(&self) -> Result<(), Failure> {
        if let Some(name) = &self.name {
            characterised(name).map_err(Failure::input)?;
        }
        self.choice.scheme()?;
        self.constants.emf().map(drop)
    }

    pub(crate) fn execute(self, session: &mut Session<Line>) -> Result<(), Trouble> {
        let before = session.protection(self.motor)?;
        let protection = self.protect(before)?;
        let changes = self.name.is_some() || !self.choice.is_empty() || !self.constants.is_empty();
        let mut setup = session.setup(self.motor)?;
        // All settings are checked before the first one is written.
        let wanted = changes.then(|| self.change(setup)).transpose()?;
        if protection != before {
            session.set_protection(self.motor, protection)?;
        }
        if let Some(word) = self.bridge {
            session.set_timing(self.motor, word.into())?;
        }
        let timing = session.timing(self.motor)?;
        if let Some(wanted) = wanted {
            session.set_up(self.motor, wanted)?;
            setup = session.setup(self.motor)?;
        }
        let condition = session.condition(self.motor)?;
        let motion = session.motion(self.motor)?;
        self.show(setup, motion, protection, timing, condition)
    }

    fn change(&self, mut setup: Setup) -> Result<Setup, Failure> {
        if let Some(name) = &self.name {
            let motor = characterised(name).map_err(Failure::input)?;
            let winding = winding(&motor).map_err(Failure::input)?;
            setup.emf = winding.emf;
            setup.resistance = Some(winding.resistance);
            setup.inductance = winding.inductance;
        }
        setup.emf = self.constants.emf()?.unwrap_or(setup.emf);
        setup.resistance = self.constants.resistance()?.or(setup.resistance);
        setup.inductance = self.constants.inductance()?.or(setup.inductance);
        if let Some(scheme) = self.choice.scheme()? {
            setup.scheme = scheme;
        }
        if let Some(duty) = self.choice.duty() {
            setup.duty = duty;
        }
        if setup.duty == DutyRule::LinearCurrent && setup.resistance.is_none() {
            let why = "linear current needs the winding's resistance: give the motor by --type, or give --resistance-ohm";
            return Err(Failure::input(why));
        }
        Ok(setup)
    }

    fn protect(&self, before: Protection) -> Result<Protection, Failure> {
        let thermal = match (self.continuous_current, &self.name) {
            (Some(ma), _) => {
                let (winding_s, case_s) = (ThermalLimit::USUAL_WINDING_S, ThermalLimit::USUAL_CASE_S);
                ThermalLimit::new(ma, winding_s, case_s).ok()
            }
            (None, Some(name)) => {
                let motor = characterised(name).map_err(Failure::input)?;
                Some(thermal_limit(&motor).map_err(Failure::input)?)
            }
            (None, None) => before.thermal,
        };
        Ok(Protection { on_fault: self.on_fault.map_or(before.on_fault, OnFault::from), thermal })
    }

    fn show(
        &self,
        setup: Setup,
        motion: Motion,
        protection: Protection,
        timing: Timing,
        condition: Condition,
    ) -> Result<(), Trouble> {
        let Setup { emf, resistance, inductance, scheme, duty } = setup;
        let emf = f64::from(emf.to_bits()) / f64::from(1 << 20);
        let ohms = resistance.map(|resistance| f64::from(resistance.as_milliohms()) / 1e3);
        let millihenries = inductance.map(|inductance| f64::from(inductance.as_microhenries()) / 1e3);
        let duty = match duty {
            DutyRule::LinearCurrent => "linear current",
            DutyRule::LinearDuty => "linear duty",
        };
        let on_fault = match protection.on_fault {
            OnFault::Coast => "coast",
            OnFault::Brake => "brake",
        };
        let bridge = match timing {
            Timing::IDEAL => "ideal",
            Timing::VNH5019 => "vnh5019",
            _ => "other",
        };
        let heat = protection.thermal.map(|_| f64::from(condition.heat) / 10.0);
        let state = match condition {
            Condition { bridge_fault: true, .. } => "off: the bridge switched itself off",
            Condition { overheated: true, .. } => "off: the winding is too hot",
            Condition { derated: true, .. } => "derated: the winding is hot, and the current is limited",
            _ => "normal",
        };
        let amperes = protection.thermal.map(|limit| f64::from(limit.continuous_ma()) / 1e3);
        if self.json {
            let words = json!(SchemeWords(scheme));
            let document = json!({
                "motor": self.motor,
                "emf_mv_s_per_count": emf,
                "resistance_ohm": ohms.unwrap_or(0.0),
                "inductance_mh": millihenries.unwrap_or(0.0),
                "scheme": words["scheme"],
                "blend": words["blend"],
                "duty": duty.replace(' ', "-"),
                "bridge": bridge,
                "on_fault": on_fault,
                "heat_percent": heat,
                "derated": condition.derated,
                "overheated": condition.overheated,
                "bridge_fault": condition.bridge_fault,
                "measured_current_a": condition.measured_ma.map(|ma| f64::from(ma) / 1e3),
                "current_line": line_word(condition.sense_line),
                "continuous_current_a": amperes,
                "motion": tune::settings(motion),
            });
            return Ok(print_json(&document)?);
        }
        let known = |value: Option<f64>, unit: &str| {
            value.map_or_else(|| "not configured".to_owned(), |value| format!("{value:.3} {unit}"))
        };
        let mut table = table::new(&["motor", &self.motor.to_string()], 2);
        table
            .add_row(["back EMF", &format!("{emf:.4} mV s/count")])
            .add_row(["resistance", &known(ohms, "ohm")])
            .add_row(["inductance", &known(millihenries, "mH")])
            .add_row(["scheme", &describe(scheme)])
            .add_row(["duty", duty])
            .add_row(["bridge", bridge])
            .add_row([
                "heat",
                &heat.map_or_else(
                    || "no thermal limit configured".to_owned(),
                    |heat| format!("{heat:.1} % of the thermal limit"),
                ),
            ])
            .add_row(["state", state])
            .add_row(["at a fault", on_fault])
            .add_row([
                "continuous current",
                &amperes.map_or_else(|| "no limit".to_owned(), |a| format!("{a:.3} A")),
            ]);
        for (name, value) in tune::rows(motion) {
            table.add_row([name, &value]);
        }
        Ok(print(&format!("{table}\n"))?)
    }
}

const fn line_word(line: SenseLine) -> &'static str {
    match line {
        SenseLine::Absent => "absent",
        SenseLine::Sound => "sound",
        SenseLine::Silent => "silent",
        SenseLine::Stuck => "stuck",
        SenseLine::Excessive => "excessive",
    }
}
