//! A bridge's current-sense line as it is connected, and what may be wrong with it.
//!
//! ```
//! use simulated::current_line::CurrentLine;
//!
//! assert_eq!(CurrentLine::Sound.volts(2.0), Some(0.28));
//! assert_eq!(CurrentLine::StuckLow.volts(2.0), Some(0.0));
//! assert_eq!(CurrentLine::Absent.volts(2.0), None);
//! ```

/// Of the usual carriers of a VNH5019A-E.
const VOLTS_PER_AMPERE: f64 = 0.14;
/// What a pin's protection lets it rise to.
const HIGHEST_V: f64 = 3.3;

/// How a line is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CurrentLine {
    /// There is none.
    #[default]
    Absent,
    /// It shows what its bridge senses.
    Sound,
    /// It is on ground for ever.
    StuckLow,
    /// It is on the supply for ever.
    StuckHigh,
}

impl CurrentLine {
    /// Its voltage behind its filter while the bridge senses so many amperes; `None` if there is none.
    #[must_use]
    pub fn volts(self, amperes: f64) -> Option<f64> {
        match self {
            Self::Absent => None,
            Self::Sound => Some((VOLTS_PER_AMPERE * amperes).clamp(0.0, HIGHEST_V)),
            Self::StuckLow => Some(0.0),
            Self::StuckHigh => Some(HIGHEST_V),
        }
    }
}
