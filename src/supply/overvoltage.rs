//! Overvoltage: decides when braking motors must dissipate the energy that they would return to the bus.
//!
//! ```text
//!                      predicted > burn
//!     +------+ ------------------------------------> +------------+
//!     | idle |                                       | dissipates |
//!     +------+ <------------------------------------ +------------+
//!               predicted <= burn for HOLD_MICROS
//!
//!     predicted = voltage + rise since the last sample
//!     share     = (predicted - burn) / (BAND_FRACTION_AT_ALL * (burn_all - burn)), at most 1;
//!                 the smallest share above 0 while predicted <= burn
//! ```
//!
//! Proportional braking is a boost chopper: one ampere lifts 1000 uF by one volt in a millisecond. The filtered voltage
//! is therefore too slow. The decision uses each sample, extrapolated by one sampling interval.

use super::limits::{Levels, Limits};
use crate::units::{Micros, Millivolts, Share};

/// Longest interval in microseconds between two samples from which a rise is computed.
const MAX_RISE_INTERVAL_MICROS: u64 = 2_500;

/// Fraction of the band from `burn` to `burn_all` at which the share reaches its maximum.
///
/// The rest of the band absorbs the energy that returns before the bridges follow. It also absorbs the energy of the
/// windings, which returns when a bridge changes from a full short to driving.
const BAND_FRACTION_AT_ALL: f32 = 0.5;

/// Time in microseconds for which motors go on dissipating after the bus last exceeded `burn`.
///
/// A bus that was too high rises again as soon as motors return energy. After this time the bus counts as quiet, and
/// the converter's watchdog reports a rise immediately. With one sample a millisecond instead, the bus could rise by
/// more than the band between two samples.
const HOLD_MICROS: u64 = 50_000;

/// State of the overvoltage protection.
#[derive(Clone, Copy, Debug)]
pub(super) struct Overvoltage {
    /// The last sample and its time; `None` before the first sample.
    last_sample: Option<(Millivolts, Micros)>,
    /// Time at which the bus last exceeded `burn`; `None` while idle.
    exceeded_at: Option<Micros>,
}

impl Overvoltage {
    /// The state before the first sample: idle.
    pub(super) const IDLE: Self = Self { last_sample: None, exceeded_at: None };

    /// True while braking motors must dissipate energy.
    pub(super) const fn is_active(&self) -> bool {
        self.exceeded_at.is_some()
    }

    /// Takes a sample and returns how strongly motors must dissipate; [`Share::NONE`] while idle.
    pub(super) fn step(&mut self, limits: &Limits, voltage: Millivolts, now: Micros) -> Share {
        let Levels { burn, burn_all, .. } = limits.levels();
        let rise_mv = match self.last_sample {
            Some((last, at)) if now.since(at) <= MAX_RISE_INTERVAL_MICROS => {
                voltage.get().saturating_sub(last.get())
            }
            _ => 0,
        };
        self.last_sample = Some((voltage, now));
        let excess_mv = (u32::from(voltage.get()) + u32::from(rise_mv)).saturating_sub(u32::from(burn.get()));
        if excess_mv == 0 {
            self.exceeded_at = self.exceeded_at.filter(|at| now.since(*at) < HOLD_MICROS);
            return if self.is_active() { Share::LEAST } else { Share::NONE };
        }
        self.exceeded_at = Some(now);
        let band_mv = burn_all.get().saturating_sub(burn.get());
        Share::from_f32(excess_mv as f32 / (BAND_FRACTION_AT_ALL * f32::from(band_mv)))
    }
}
