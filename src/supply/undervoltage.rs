//! Undervoltage: limits the current that motors may draw from a weak battery.
//!
//! ```text
//!             voltage < derate               voltage <= cut
//!     +------+ ---------------> +---------+ ----------------> +-----+
//!     | Full |                  | Derated |                   | Cut |
//!     +------+ <--------------- +---------+ <---------------- +-----+
//!             voltage >= recover             voltage >= derate
//! ```
//!
//! `Full` changes to `Cut` directly when the voltage falls to `cut` between two samples. The share of current that may
//! be drawn is 0 in `Cut`. In the other stages the share is proportional to the voltage: 0 at `cut`, 1 at `derate`.
//! The share falls immediately and rises slowly, by at most 1 in [`FULL_RISE_MICROS`]. A collapse of the bus sets the
//! share to 0, and changes `Full` to `Derated`.

use super::limits::{Levels, Limits};
use crate::units::{Millivolts, Share};

/// How much current may be drawn from the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stage {
    /// The battery is not low. After a low voltage the limit of the current may still be rising.
    #[default]
    Full,
    /// The battery is low, and the current is limited.
    Derated,
    /// No current may be drawn. Motors brake or coast.
    Cut,
}

/// Time in microseconds in which the share rises from 0 to 1.
///
/// A battery's voltage recovers as soon as less current is drawn. If the share rose immediately, the supply would
/// switch between drawing and cutting.
const FULL_RISE_MICROS: f32 = 1e6;

/// State of the undervoltage protection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Derating {
    /// The present stage.
    stage: Stage,
    /// Share of the current that may be drawn, 0 to 1.
    draw: f32,
}

impl Derating {
    /// The state before the first sample: all current may be drawn.
    pub(super) const INITIAL: Self = Self { stage: Stage::Full, draw: 1.0 };

    /// Sets the share to 0 because the bus voltage has collapsed.
    pub(super) fn cut_after_collapse(&mut self) -> (Stage, Share) {
        if self.stage == Stage::Full {
            self.stage = Stage::Derated;
        }
        self.draw = 0.0;
        (self.stage, Share::NONE)
    }

    /// True if all current may be drawn.
    pub(super) fn allows_all(&self) -> bool {
        self.stage == Stage::Full && self.draw >= 1.0
    }

    /// Takes a filtered voltage, `passed_us` microseconds after the last one.
    pub(super) fn step(&mut self, limits: &Limits, voltage: Millivolts, passed_us: u32) -> (Stage, Share) {
        let Levels { cut, derate, recover, .. } = limits.levels();
        self.stage = match self.stage {
            _ if voltage <= cut => Stage::Cut,
            Stage::Cut if voltage < derate => Stage::Cut,
            Stage::Full if voltage >= derate => Stage::Full,
            Stage::Derated if voltage >= recover => Stage::Full,
            _ => Stage::Derated,
        };
        let limit = match self.stage {
            Stage::Cut => 0.0,
            Stage::Full | Stage::Derated => fraction_between(voltage, cut, derate),
        };
        self.draw = limit.min(self.draw + passed_us as f32 / FULL_RISE_MICROS);
        (self.stage, Share::from_f32(self.draw))
    }
}

/// Returns where a voltage lies between two others: 0 at `low` and below, 1 at `high` and above.
fn fraction_between(voltage: Millivolts, low: Millivolts, high: Millivolts) -> f32 {
    let above_low_mv = |voltage: Millivolts| f32::from(voltage.get().saturating_sub(low.get()));
    if voltage >= high { 1.0 } else { above_low_mv(voltage) / above_low_mv(high) }
}
