//! Scenarios: which motors with which loads are told what, and when.
//!
//! A scenario is a TOML file; `docs/reference/scenarios.md` lists its keys. [`Scenario::parse`] reads it and refuses
//! what is unknown, out of range or contradictory, with file, line and column; a `Scenario` that exists can
//! be run. With expectations it is a test.
//!
//! ```
//! use simulated::scenario::Scenario;
//!
//! let wrong = "name = \"too long\"\nduration_s = 301\nmotors = []\nbattery = { emf_v = 12, resistance_ohm = 0.1 }";
//! let refused = Scenario::parse("my.toml", wrong).unwrap_err().to_string();
//! assert_eq!(refused, "my.toml:2:14: duration_s = 301 is out of range; allowed is 0.001 to 300");
//! ```

mod definition;
pub mod expectation;
mod file;
mod mistake;
mod substitute;

use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::characterised;
use motor_hub::model::friction::Friction;
use motor_hub::model::si::{NewtonMetres, Volts};
use std::path::Path;

pub use definition::{Bus, Group, LONGEST_S, Motor, Scenario, Timed, Told, ToldMotion, UNLIMITED};
pub use mistake::{Mistake, ScenarioError, line_and_column};

/// Dry friction of motors that are served, of their stall torque at 12 V.
const SERVED_FRICTION: f64 = 0.06;

/// What drives the fan when it is served. What hosts set velocity loops to is meant for motors that turn at some 2500 counts/s;
/// the scenario's own AM 3.7 B turns at 650, and takes five seconds for P 2, I 0.5, F 11.1, with a load or without.
const SERVED_FAN: &str = "AM 20 A";

/// What runs when no file is named.
const DEFAULT: (&str, &str) = ("scenarios/default.toml", include_str!("../scenarios/default.toml"));

impl Scenario {
    /// Reads a scenario; `file` is what errors call it.
    ///
    /// # Errors
    /// [`ScenarioError::Wrong`]; shown, it is one line.
    pub fn parse(file: &str, text: &str) -> Result<Self, ScenarioError> {
        file::read(text, true).map_err(|fault| fault.in_file(file, text))
    }

    /// Reads a scenario file.
    ///
    /// # Errors
    /// As [`Scenario::parse`], or why the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        let (file, text) = text_of(path)?;
        Self::parse(&file, &text)
    }

    /// Reads a scenario file whose set-points are left to somebody else: there need not be any.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn load_for_a_host(path: &Path) -> Result<Self, ScenarioError> {
        let (file, text) = text_of(path)?;
        file::read(&text, false).map_err(|fault| fault.in_file(&file, &text))
    }

    /// What is served when no file is named: the motors and loads of the scenario that the program carries, for a host to
    /// do something with. Nothing pulls on them, all are under Scheme A, dry friction stops them about as soon as
    /// real gear motors, and an AM 20 A drives the fan.
    ///
    /// # Errors
    /// None, as a test makes sure.
    pub fn to_serve() -> Result<Self, ScenarioError> {
        let mut scenario = Self::default_one()?.undisturbed();
        if let (Some(fan), Ok(motor)) = (scenario.motors.last_mut(), characterised(SERVED_FAN)) {
            *fan = fan.with_constants(motor.with_measured_rotor_inertia());
        }
        for motor in &mut scenario.motors {
            motor.scheme = Scheme::A;
            let stall = motor.constants.stall_torque(Volts(12.0));
            motor.constants.friction = Friction::with_coulomb(NewtonMetres(SERVED_FRICTION * stall.0));
        }
        Ok(scenario)
    }

    /// The scenario that the program carries.
    ///
    /// # Errors
    /// None, as a test makes sure.
    pub fn default_one() -> Result<Self, ScenarioError> {
        let (file, text) = DEFAULT;
        Self::parse(file, text)
    }
}

/// What errors call a file, and what is in it.
fn text_of(path: &Path) -> Result<(String, String), ScenarioError> {
    let file = path.display().to_string();
    match std::fs::read_to_string(path) {
        Ok(text) => Ok((file, text)),
        Err(source) => Err(ScenarioError::Unreadable { file, source }),
    }
}
