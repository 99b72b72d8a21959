//! A bus that cannot take back what braking motors return: they burn it instead.
//!
//! Proportional braking is a boost chopper: an ampere lifts 1000 uF by a volt in a millisecond. So this looks at
//! every sample, not at the filter, and ahead by the time until the next one.

use super::limits::{Levels, Limits};
use crate::units::{Micros, Millivolts, Share};

/// Samples further apart than this say nothing of how fast the voltage rises.
const CLOSE_MICROS: u64 = 2_500;

/// From this part of the band on most is drawn: the rest is for what comes back until the bridges follow, and for
/// the energy of windings, which returns when a bridge leaves a full short to drive.
const ALL_FROM: f32 = 0.5;

/// Burning goes on for so long after a bus was too high, for it is again as soon as motors return anything. Then the bus is
/// quiet, and is heard of the instant that it rises; were it only looked at every millisecond, it could rise in between by
/// more than the band.
const WATCHED_MICROS: u64 = 50_000;

#[derive(Clone, Copy, Debug)]
pub(super) struct Burning {
    last: Option<(Millivolts, Micros)>,
    /// When it was too high last, while burning goes on for that.
    high: Option<Micros>,
}

impl Burning {
    pub(super) const NEW: Self = Self { last: None, high: None };

    /// True if something is to be burnt.
    pub(super) const fn is_on(&self) -> bool {
        self.high.is_some()
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
        if above == 0 {
            self.high = self.high.filter(|high| now.since(*high) < WATCHED_MICROS);
            return if self.high.is_none() { Share::NONE } else { Share::LEAST };
        }
        self.high = Some(now);
        let band = burn_all.get().saturating_sub(burn.get());
        Share::from_f32(above as f32 / (ALL_FROM * f32::from(band)))
    }
}
