//! Scenarios: motors with loads, and their set-points over time.
//!
//! A scenario is a TOML file; `docs/reference/scenarios.md` lists its keys. [`Scenario::parse`] reads a file. An error
//! names file, line and column of what is unknown, out of range or contradictory. A `Scenario` with expectations is a
//! test.
//!
//! ```
//! use simulated::scenario::Scenario;
//!
//! let wrong = "name = \"too long\"\nduration_s = 301\nmotors = []\nbattery = { emf_v = 12, resistance_ohm = 0.1 }";
//! let refused = Scenario::parse("my.toml", wrong).unwrap_err().to_string();
//! assert_eq!(refused, "my.toml:2:14: duration_s = 301 is out of range; allowed is 0.001 to 300");
//! ```

mod error;
pub mod expectation;
mod file;
pub(crate) mod numbers;
mod other_motor;
mod types;

use motor_hub::model::catalogue::{self, characterised};
use motor_hub::model::load::Load;
use motor_hub::model::si::{Drag, KgM2, Volts};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

pub use error::{ScenarioError, line_and_column};
pub use numbers::{LONGEST_S, number_text};
pub use types::{Attached, Bus, Configuration, Group, Motor, Scenario, Timed};

/// Dry friction of the motors of the served scenario, in percent of their stall torque at 12 V.
const SERVED_FRICTION_PERCENT: f64 = 6.0;

/// Motor of the fan in the served scenario. The usual velocity coefficients of hosts suit motors of some 2500 counts/s.
/// The NeveRest 3.7 of the default scenario turns at some 700 counts/s. With P 2, I 0.5 and F 11.1 the error of its
/// speed decays with a time constant of 5 s, with a load or without.
const SERVED_FAN: &str = "NeveRest 20";

impl Scenario {
    /// Reads the text of a scenario. Errors have the file name `file`.
    ///
    /// # Errors
    /// [`ScenarioError::Wrong`], whose message is one line.
    pub fn parse(file: &str, text: &str) -> Result<Self, ScenarioError> {
        parse(file, text, true)
    }

    /// Reads a scenario file.
    ///
    /// # Errors
    /// As [`Scenario::parse`], or why the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        load(path, true)
    }

    /// Reads a scenario file for a host that commands the motors. The scenario needs no set-points.
    ///
    /// # Errors
    /// As [`Scenario::load`].
    pub fn load_for_a_host(path: &Path) -> Result<Self, ScenarioError> {
        load(path, false)
    }

    /// The scenario that is served if no file is given. The motors and loads are those of the default scenario, without
    /// torques, all under Scheme A. Dry friction stops the motors in about the same time as real gear motors. A
    /// NeveRest 20 drives the fan.
    ///
    /// The scenario is not read from a file, so that a program that only serves it holds no parser of scenario files.
    pub fn to_serve() -> Self {
        let constants = |name: &str| characterised(name).map(catalogue::Motor::with_measured_rotor_inertia);
        let served = |(label, name, inertia, drag): (&str, &str, f64, f64)| {
            let load = Load { drag_after: Drag(drag), ..Load::inertia(KgM2(inertia)) };
            let motor = Motor::new(constants(name).ok()?, load);
            let mut motor =
                if label == "fan" { motor.with_constants(constants(SERVED_FAN).ok()?) } else { motor };
            (motor.label, motor.torques) = (label.to_owned(), Vec::new());
            motor.set_friction(SERVED_FRICTION_PERCENT);
            Some(motor)
        };
        let motors = [
            ("flywheel", "AM 20 A", 0.006, 0.0),
            ("winch", "AM 60 A", 0.05, 0.0),
            ("arm", "AM 40 C", 0.02, 0.005),
            ("fan", "AM 3.7 B", 0.0004, 0.0005),
        ];
        let motors = motors.into_iter().filter_map(served).collect();
        let mut scenario = Self::new("Four motors", LONGEST_S, motors);
        scenario.battery.emf = Volts(12.6);
        scenario
    }

    /// The default scenario, which is part of the program.
    ///
    /// # Errors
    /// None: a test checks that the scenario is valid.
    pub fn default_one() -> Result<Self, ScenarioError> {
        Self::parse("scenarios/default.toml", include_str!("../scenarios/default.toml"))
    }
}

/// Largest text file in bytes that this program reads: far more than any scenario or settings file needs.
const LARGEST_TEXT: u64 = 1 << 20;

/// Reads a text file of 1 MiB at most. A device such as `/dev/zero` has no end.
///
/// # Errors
/// The file cannot be read, is no UTF-8 text, or is larger.
pub fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_at_most(LARGEST_TEXT, File::open(path)?)?).map_err(io::Error::other)
}

/// Reads `largest` bytes at most.
///
/// # Errors
/// Reading fails, or there are more bytes.
pub fn read_at_most(largest: u64, from: impl Read) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    from.take(largest + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > largest {
        return Err(io::Error::other(format!("more than {largest} bytes, the largest size allowed")));
    }
    Ok(bytes)
}

/// Reads a file. If `is_complete` is true, every motor needs a set-point or a group.
fn load(path: &Path, is_complete: bool) -> Result<Scenario, ScenarioError> {
    let file = path.display().to_string();
    match read_text(path) {
        Ok(text) => parse(&file, &text, is_complete),
        Err(source) => Err(ScenarioError::Unreadable { file, source }),
    }
}

fn parse(file: &str, text: &str, is_complete: bool) -> Result<Scenario, ScenarioError> {
    file::read(text, is_complete).map_err(|fault| fault.in_file(file, text))
}
