//! Undervoltage: limits the current that motors may draw from a weak battery.
//!
//! ```text
//!             voltage < derate               voltage <= cutoff
//!     +------+ ---------------> +---------+ ----------------> +--------+
//!     | Full |                  | Derated |                   | Cutoff |
//!     +------+ <--------------- +---------+ <---------------- +--------+
//!             voltage >= recover             voltage >= derate
//! ```
//!
//! `Full` changes to `Cutoff` directly when the voltage falls to `cutoff` between two samples.
//!
//! The *draw* is the current that each motor may draw, as a share of its current at standstill and full duty. It is 0
//! in `Cutoff`. In the other stages the draw rises linearly with the voltage, from 0 at `cutoff` to 1 at `derate`, and is
//! 1 above. The draw falls immediately. It rises by at most 1 in [`FULL_RISE_MICROS`]. A
//! [collapse](super::Supply::step) of the bus sets the draw to 0, and changes `Full` to `Derated`.

use super::limits::{Levels, Limits};
use crate::units::{Millivolts, Share};

/// Stage of the limit on the current that motors draw from the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DrawStage {
    /// The battery is not low. The draw is 1, or still rises to 1 after a low voltage.
    #[default]
    Full,
    /// The battery is low. The draw is below 1 while the voltage is below [`Levels::derate`], and until the draw has
    /// risen to 1 again.
    Derated,
    /// The voltage fell to [`Levels::cutoff`] and is not back at [`Levels::derate`]. Motors may draw no current, and only
    /// brake or coast.
    Cutoff,
    /// The newest sample is above [`Levels::max`]. Motors may draw no current, and only brake or coast. The battery is
    /// not low.
    Overvoltage,
}

/// Time in microseconds in which the draw rises from 0 to 1.
///
/// A battery's voltage recovers as soon as motors draw less current. If the draw rose immediately, the stage would
/// alternate between `Cutoff` and `Derated`.
const FULL_RISE_MICROS: f32 = 1e6;

/// State of the undervoltage protection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Derating {
    stage: DrawStage,
    /// The draw, 0 to 1.
    draw: f32,
}

impl Derating {
    /// The state before the first sample. Motors may draw all current.
    pub(super) const INITIAL: Self = Self { stage: DrawStage::Full, draw: 1.0 };

    /// Sets the draw to 0 because the bus voltage has collapsed.
    pub(super) fn draw_nothing_after_collapse(&mut self) -> (DrawStage, Share) {
        if self.stage == DrawStage::Full {
            self.stage = DrawStage::Derated;
        }
        self.draw = 0.0;
        (self.stage, Share::NONE)
    }

    /// True if motors may draw all current.
    pub(super) fn allows_all(&self) -> bool {
        self.stage == DrawStage::Full && self.draw >= 1.0
    }

    /// Updates stage and draw from the filtered voltage, `passed_us` microseconds after the last update.
    pub(super) fn step(
        &mut self,
        limits: &Limits,
        voltage: Millivolts,
        passed_us: u32,
    ) -> (DrawStage, Share) {
        let Levels { cutoff, derate, recover, .. } = limits.levels();
        self.stage = match self.stage {
            _ if voltage <= cutoff => DrawStage::Cutoff,
            DrawStage::Cutoff if voltage < derate => DrawStage::Cutoff,
            DrawStage::Full if voltage >= derate => DrawStage::Full,
            DrawStage::Derated if voltage >= recover => DrawStage::Full,
            _ => DrawStage::Derated,
        };
        let limit = match self.stage {
            DrawStage::Cutoff => 0.0,
            _ => fraction_between(voltage, cutoff, derate),
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
