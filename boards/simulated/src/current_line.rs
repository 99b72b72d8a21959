//! The current-sense line of a bridge, sound or broken.
//!
//! ```
//! use simulated::current_line::CurrentLine;
//!
//! assert_eq!(CurrentLine::Sound.volts(2.0), Some(0.28));
//! assert_eq!(CurrentLine::StuckLow.volts(2.0), Some(0.0));
//! assert_eq!(CurrentLine::Absent.volts(2.0), None);
//! ```

/// Sensitivity of the current-sense line on the usual carriers of a VNH5019A-E.
const VOLTS_PER_AMPERE: f64 = 0.14;
/// Highest voltage of the line: the protection of the pin limits it.
const HIGHEST_V: f64 = 3.3;

/// Condition of a current-sense line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CurrentLine {
    /// No line is connected.
    #[default]
    Absent,
    /// The line shows the current that the bridge senses.
    Sound,
    /// The line is shorted to ground.
    StuckLow,
    /// The line is shorted to the supply.
    StuckHigh,
}

impl CurrentLine {
    /// Returns the voltage of the line behind its filter, at a current of the bridge in amperes; `None` without a line.
    pub fn volts(self, amperes: f64) -> Option<f64> {
        match self {
            Self::Absent => None,
            Self::Sound => Some((VOLTS_PER_AMPERE * amperes).clamp(0.0, HIGHEST_V)),
            Self::StuckLow => Some(0.0),
            Self::StuckHigh => Some(HIGHEST_V),
        }
    }
}
