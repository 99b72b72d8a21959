//! Options that choose what is simulated: the scenario, its motors, the control period.

use crate::output::Failure;
use crate::parse::whole;
use motor_hub::model::catalogue::{Motor, characterised};
use motor_hub::units::Period;
use simulated::hardware::MOTORS;
use simulated::scenario::Scenario;
use std::path::PathBuf;

/// The scenario, and what is replaced in it.
#[derive(clap::Args)]
pub(crate) struct ScenarioOptions {
    /// Scenario file (TOML) instead of the default scenario
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Motor of the catalogue that replaces the default scenario's first, second, ... motor, with speeds and loads in
    /// proportion; given up to four times. The run has only the motors that are named
    #[arg(long, value_name = "NAME", conflicts_with = "scenario", value_parser = characterised)]
    motor: Vec<Motor>,
    /// Control period in milliseconds
    #[arg(long = "period-ms", alias = "period", value_name = "MS")]
    #[arg(value_parser = whole("a control period", 1..=100_u32, "ms"))]
    period: Option<u32>,
}

impl ScenarioOptions {
    /// Returns the scenario of the file, or the default scenario as changed by `default`. The other options are then
    /// applied.
    pub(crate) fn scenario(&self, default: impl FnOnce(Scenario) -> Scenario) -> Result<Scenario, Failure> {
        let scenario = match &self.scenario {
            Some(path) => Scenario::load(path),
            None => Scenario::default_one().map(default),
        };
        let mut scenario = scenario.map_err(Failure::input)?;
        self.replace_motors(&mut scenario)?;
        if let Some(ms) = self.period {
            scenario.period = Period::from_millis(ms).map_err(Failure::input)?;
        }
        Ok(scenario)
    }

    fn replace_motors(&self, scenario: &mut Scenario) -> Result<(), Failure> {
        let times = self.motor.len();
        if times > MOTORS {
            let why = format!("--motor is given {times} times; the hub drives at most {MOTORS} motors");
            return Err(Failure::Input(why));
        }
        if times > 0 {
            scenario.motors.truncate(times);
        }
        for (motor, constants) in scenario.motors.iter_mut().zip(&self.motor) {
            *motor = motor.with_constants(constants.with_measured_rotor_inertia());
        }
        Ok(())
    }
}
