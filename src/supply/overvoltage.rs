//! A bus that cannot take back what braking motors return: they burn it instead.
//!
//! Proportional braking is a boost chopper: an ampere lifts 1000 uF by a volt in a millisecond. So this looks at
//! every sample, not at the filter, and ahead by the time until the next one.

use super::limits::{Levels, Limits};
use crate::units::{Micros, Millivolts, Share};

/// Samples further apart than this say nothing of how fast the voltage rises.
const CLOSE_MICROS: u64 = 2_500;

/// All is burnt from this part of the band on: the rest is for what comes back until the bridges follow, and for
/// the energy of windings, which returns when a bridge leaves a full short to drive.
const ALL_FROM: f32 = 0.5;

#[derive(Clone, Copy, Debug)]
pub(super) struct Burning {
    last: Option<(Millivolts, Micros)>,
    on: bool,
}

impl Burning {
    pub(super) const NEW: Self = Self { last: None, on: false };

    /// True if anything was to be burnt last.
    pub(super) const fn is_on(&self) -> bool {
        self.on
    }

    /// How far bridges are to burn.
    pub(super) fn step(&mut self, limits: &Limits, voltage: Millivolts, now: Micros) -> Share {
        let Levels { burn, burn_all, .. } = limits.levels();
        let rise = match self.last {
            Some((last, at)) if now.since(at) <= CLOSE_MICROS => voltage.get().saturating_sub(last.get()),
            _ => 0,
        };
        self.last = Some((voltage, now));
        let above = (u32::from(voltage.get()) + u32::from(rise)).saturating_sub(u32::from(burn.get()));
        self.on = above > 0;
        if !self.on {
            return Share::NONE;
        }
        let band = burn_all.get().saturating_sub(burn.get());
        Share::from_f32(above as f32 / (ALL_FROM * f32::from(band)))
    }
}
