//! Scenarios: which motors with which loads are told what, and when.
//!
//! A scenario is a TOML file; `docs/scenarios.md` lists its keys. [`Scenario::parse`] reads it and refuses
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

use std::path::Path;

pub use definition::{Bus, Group, LONGEST_S, Motor, Scenario, Timed, Told, ToldMotion, UNLIMITED};
pub use mistake::{Mistake, ScenarioError};

/// What runs when no file is named.
const DEFAULT: (&str, &str) = ("scenarios/default.toml", include_str!("../scenarios/default.toml"));

impl Scenario {
    /// Reads a scenario; `file` is what errors call it.
    ///
    /// # Errors
    /// [`ScenarioError::Wrong`]; shown, it is one line.
    pub fn parse(file: &str, text: &str) -> Result<Self, ScenarioError> {
        file::read(text).map_err(|fault| fault.in_file(file, text))
    }

    /// Reads a scenario file.
    ///
    /// # Errors
    /// As [`Scenario::parse`], or why the file cannot be read.
    pub fn load(path: &Path) -> Result<Self, ScenarioError> {
        let file = path.display().to_string();
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(source) => return Err(ScenarioError::Unreadable { file, source }),
        };
        Self::parse(&file, &text)
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
