//! A battery near its end: ever less may be drawn, then nothing, and back with hysteresis.

use super::limits::{Levels, Limits};
use crate::units::{Millivolts, Share};

/// How much may be drawn from the bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Stage {
    /// All that is asked for.
    #[default]
    Full,
    /// The battery is low: less.
    Derated,
    /// Nothing: motors brake, or coast.
    Cut,
}

/// What may be drawn falls with the voltage at once, but rises again no faster than from nothing to all in this
/// time: a battery recovers as soon as less is drawn, and would have it drawn and cut in turn.
const RISE_MICROS: f32 = 1e6;

#[derive(Clone, Copy, Debug)]
pub(super) struct Derating {
    stage: Stage,
    /// A share.
    draw: f32,
}

impl Derating {
    pub(super) const NEW: Self = Self { stage: Stage::Full, draw: 1.0 };

    /// Whatever it was, nothing is drawn for now.
    pub(super) fn break_down(&mut self) -> (Stage, Share) {
        if self.stage == Stage::Full {
            self.stage = Stage::Derated;
        }
        self.draw = 0.0;
        (self.stage, Share::NONE)
    }

    /// True if all may be drawn.
    pub(super) fn is_over(&self) -> bool {
        self.stage == Stage::Full && self.draw >= 1.0
    }

    /// So many microseconds after the sample before.
    pub(super) fn step(&mut self, limits: &Limits, voltage: Millivolts, passed: u32) -> (Stage, Share) {
        let Levels { cut, derate, recover, .. } = limits.levels();
        self.stage = match self.stage {
            _ if voltage <= cut => Stage::Cut,
            Stage::Cut if voltage < derate => Stage::Cut,
            Stage::Full if voltage >= derate => Stage::Full,
            Stage::Derated if voltage >= recover => Stage::Full,
            _ => Stage::Derated,
        };
        let most = match self.stage {
            Stage::Cut => 0.0,
            Stage::Full | Stage::Derated => within(voltage, cut, derate),
        };
        self.draw = most.min(self.draw + passed as f32 / RISE_MICROS);
        (self.stage, Share::from_f32(self.draw))
    }
}

/// How far a voltage lies between two others, 0 to 1.
fn within(voltage: Millivolts, low: Millivolts, high: Millivolts) -> f32 {
    let above = |voltage: Millivolts| f32::from(voltage.get().saturating_sub(low.get()));
    if voltage >= high { 1.0 } else { above(voltage) / above(high) }
}
