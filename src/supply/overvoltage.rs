//! Overvoltage: decides when braking motors must dissipate the energy that they would return to the bus.
//!
//! ```text
//!                     predicted > dissipate
//!     +------+ ------------------------------------> +------------+
//!     | idle |                                       | dissipates |
//!     +------+ <------------------------------------ +------------+
//!               predicted <= dissipate for HOLD_MICROS
//!
//!     predicted = voltage + rise since the last sample
//!     share     = (predicted - dissipate) / (BAND_FRACTION_AT_FULL_SHARE * (ceiling - dissipate)), at most 1
//!     share     = Share::LEAST while predicted <= dissipate, until HOLD_MICROS have passed
//! ```
//!
//! A braking motor returns energy to the bus through its bridge, which works as a boost converter. One ampere lifts the
//! voltage of 1000 uF by one volt in a millisecond. The filtered voltage follows too slowly. The *predicted* voltage is
//! therefore the last sample, extrapolated by one sampling interval. The *share* is the strength with which braking
//! motors dissipate energy, 0 to 1.

use super::Battery;
use super::limits::{Levels, Limits};
use crate::units::{Micros, Millivolts, Share};

/// Longest interval in microseconds between two samples for which the rise is computed: two and a half sampling
/// intervals. After a longer interval the rise is taken as 0.
const MAX_RISE_INTERVAL_MICROS: u64 = 2_500;

/// Fraction of the band from `dissipate` to `ceiling` at which the share reaches 1.
///
/// The rest of the band is a reserve for energy that still returns to the bus. Energy returns until the bridges have
/// changed their commands. The energy of a winding also returns each time the bridge changes from a full short to
/// driving.
const BAND_FRACTION_AT_FULL_SHARE: f32 = 0.5;

/// Time in microseconds for which motors go on dissipating after the predicted voltage last exceeded `dissipate`.
///
/// Without this time the motors would return energy again immediately, and the voltage would rise again. After this
/// time the bus can be quiet, and then the converter's analog watchdog reports the next rise immediately. Samples every
/// millisecond would show the next rise too late: between two samples the voltage could rise by the whole band.
const HOLD_MICROS: u64 = 50_000;

/// Processes the sample `voltage`, and returns the strength with which motors must dissipate energy. The result is
/// [`Share::NONE`] while idle.
///
/// `exceeded_at` is the time at which the predicted voltage last exceeded `dissipate`, and `None` while idle. `last` is
/// the state of the bus at the sample before, and `None` if there was no plausible sample before.
pub(super) fn step(
    exceeded_at: &mut Option<Micros>,
    limits: &Limits,
    last: Option<&Battery>,
    voltage: Millivolts,
    now: Micros,
) -> Share {
    let Levels { dissipate, ceiling, .. } = limits.levels();
    let rise_mv = match last {
        // The last sample is capped at `max`. Above `max` the share is 1 with any rise.
        Some(last) if now.since(last.at) <= MAX_RISE_INTERVAL_MICROS => {
            voltage.get().saturating_sub(last.newest.get())
        }
        _ => 0,
    };
    let excess_mv =
        (u32::from(voltage.get()) + u32::from(rise_mv)).saturating_sub(u32::from(dissipate.get()));
    if excess_mv == 0 {
        *exceeded_at = exceeded_at.filter(|at| now.since(*at) < HOLD_MICROS);
        return if exceeded_at.is_some() { Share::LEAST } else { Share::NONE };
    }
    *exceeded_at = Some(now);
    let band_mv = ceiling.get().saturating_sub(dissipate.get());
    Share::from_f32(excess_mv as f32 / (BAND_FRACTION_AT_FULL_SHARE * f32::from(band_mv)))
}
