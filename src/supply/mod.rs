//! The bus that battery and bridges share: filters its measured voltage, and limits the current that motors may draw
//! from the bus and return to it.
//!
//! ```text
//!         min       cutoff      derate    recover     dissipate     ceiling       max
//!  --------+----------+-----------+----------+------------+------------+-----------+-----> bus voltage
//!    not   |  Cutoff  |  Derated  |  Full or |    Full    |  Full, and braking motors | Overvoltage
//! plausible| draw 0   | draw 0..1 |  Derated | draw to 1  |  dissipate energy         | motors dissipate
//! ```
//!
//! * The *draw* is a share from 0 to 1. The draw is the current that a motor may take from the bus, divided by its
//!   current at standstill and full duty. After the stage `Derated` the draw rises to 1 within a second.
//! * The [`DrawStage`] has hysteresis. The stage `Full` lasts until the filtered voltage is below `derate`. The stage
//!   `Derated` lasts until the filtered voltage reaches `recover`. The stage `Cutoff` lasts until the filtered voltage
//!   is back at `derate`.
//! * Braking motors *dissipate* energy when their bridges turn energy to heat instead of returning it to the bus. The
//!   bridge then alternates between two pulses, each of some milliseconds. The first pulse shorts the winding, and the
//!   motor's energy becomes heat. When the short circuit ends, the winding's current flows back into the bus for a
//!   moment. The second pulse drives the motor slightly above its back EMF, and so draws about the same energy from the
//!   bus again.
//! * Dissipation begins when the voltage that a rising bus will have one sample later exceeds `dissipate`. From halfway
//!   between `dissipate` and `ceiling` on, braking motors dissipate with full strength.
//! * The *quiet range* is the range from `derate` to `dissipate`. The bus is *quiet* if its voltage is in this range
//!   and the supply limits no motor. A quiet bus is sampled every 10 ms only. An analog watchdog reports when the
//!   voltage leaves the range.
//!
//! [`VrefintScale`] converts ADC readings to millivolts, on chips that also measure VREFINT, a reference voltage inside
//! of them. Boards with another converter have their own conversion.
//!
//! ```
//! use motor_hub::supply::{Limits, DrawStage, Supply};
//! use motor_hub::units::{Micros, Millivolts};
//!
//! let mut supply = Supply::new(Limits::default());
//! let battery = supply.step(Some(Millivolts::new(12_000)), Micros::new(10_000)).expect("plausible");
//! assert_eq!((battery.voltage, battery.stage), (Millivolts::new(12_000), DrawStage::Full));
//! assert_eq!(supply.step(Some(Millivolts::new(3_000)), Micros::new(20_000)), None);
//! ```

mod bus_state;
mod limits;
mod overvoltage;
mod undervoltage;
mod vrefint;

pub use bus_state::{BusReading, BusState};
pub use limits::{Levels, Limits};
pub use undervoltage::DrawStage;
pub use vrefint::{VrefintCalibration, VrefintScale};

use crate::units::{Micros, Millivolts, Share};
use core::ops::RangeInclusive;
use undervoltage::Derating;

/// Age in microseconds beyond which a battery reading is stale. The filter restarts after a longer gap between samples.
pub const BATTERY_STALE_MICROS: u64 = 100_000;

/// Time constant of the voltage filter, in microseconds. Sampling lengthens the time constant by about half an
/// interval: to 30.5 ms at 1 ms, and to 34.8 ms at 10 ms.
const FILTER_MICROS: f32 = 30_000.0;

/// Longest interval, in microseconds, that the filter uses for the first sample outside the quiet range.
///
/// Samples in the quiet range are up to 10 ms apart. The analog watchdog starts the next sample within 1 ms after the
/// voltage has left the range, so the new voltage is at most 1 ms old.
const LEFT_QUIET_MICROS: u32 = 1_000;

/// State of the bus at its newest plausible sample, and the limits that follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Battery {
    /// Filtered voltage.
    pub voltage: Millivolts,
    /// Voltage of the newest sample, at most [`Levels::max`].
    pub newest: Millivolts,
    /// Time of the newest sample.
    pub at: Micros,
    /// Stage of the draw.
    pub stage: DrawStage,
    /// Current that each motor may draw, as a share of its current at standstill and full duty.
    pub draw: Share,
    /// Strength with which braking motors must dissipate energy, as a share of full strength. With [`Share::NONE`]
    /// braking motors may return their energy to the bus.
    pub dissipate: Share,
}

impl Battery {
    /// Creates the state of a bus that does not limit its motors.
    pub const fn unlimited(voltage: Millivolts, at: Micros) -> Self {
        Self {
            voltage,
            newest: voltage,
            at,
            stage: DrawStage::Full,
            draw: Share::ALL,
            dissipate: Share::NONE,
        }
    }

    /// True unless the newest sample is older than [`BATTERY_STALE_MICROS`].
    pub const fn is_fresh(&self, now: Micros) -> bool {
        now.since(self.at) <= BATTERY_STALE_MICROS
    }
}

/// Filters the bus voltage, and derives the limits for motors.
#[derive(Clone, Debug)]
pub struct Supply {
    limits: Limits,
    /// Filtered voltage in steps of 2^-8 mV, at the time of `last_battery`. `None` before the first plausible sample. An
    /// implausible voltage or a failed conversion sets the filtered voltage to `None`.
    filtered_q8_mv: Option<i32>,
    derating: Derating,
    /// Time at which braking motors last had to dissipate energy because the predicted voltage exceeded
    /// [`Levels::dissipate`]. `None` while they may return energy.
    exceeded_at: Option<Micros>,
    /// State at the last plausible sample. `None` before the first plausible sample.
    last_battery: Option<Battery>,
    /// The last reading, plausible or not.
    last_reading: BusReading,
}

/// Returns the filtered voltage after a sample, in steps of 2^-8 mV. `before` is the filtered voltage before the sample,
/// and `None` if the filter restarts: the sample then becomes the filtered voltage.
///
/// The filter is a first-order low-pass. The weight of the sample is dt / (dt + 30 ms), where dt is `passed_us`.
fn filter(before: Option<i32>, voltage: Millivolts, passed_us: u32) -> i32 {
    let new = i32::from(voltage.get()) << 8;
    let weight = passed_us as f32 / (passed_us as f32 + FILTER_MICROS);
    before.map_or(new, |before| before + ((new - before) as f32 * weight) as i32)
}

/// Rounds a filtered voltage to millivolts. The filtered voltage is never above the largest sample, so the cast to 16
/// bits loses nothing.
const fn rounded(q8_mv: i32) -> Millivolts {
    Millivolts::new(((q8_mv + 128) >> 8) as u16)
}

impl Supply {
    /// Creates the state before the first sample.
    pub const fn new(limits: Limits) -> Self {
        Self {
            limits,
            filtered_q8_mv: None,
            derating: Derating::INITIAL,
            exceeded_at: None,
            last_battery: None,
            last_reading: BusReading::INITIAL,
        }
    }

    /// Returns the quiet range if the filtered voltage is at least [`Levels::derate`] and the supply limits no motor.
    /// `None` if the bus must be sampled every millisecond.
    pub fn quiet(&self) -> Option<RangeInclusive<Millivolts>> {
        let Levels { derate, dissipate, .. } = self.limits.levels();
        let filtered = rounded(self.filtered_q8_mv?);
        let unlimited = self.derating.allows_all() && self.exceeded_at.is_none() && filtered >= derate;
        unlimited.then_some(derate..=dissipate)
    }

    /// Processes a measured voltage, and returns the state of the bus. Must be called every millisecond; every 10 ms is
    /// enough while the bus is [quiet](Self::quiet).
    ///
    /// `voltage` is `None` if the converter did not answer. A voltage below [`Levels::min`] is not plausible. In both
    /// cases the result is `None` except in a collapse, and the next plausible sample restarts the filter.
    ///
    /// The bus has *collapsed* if two or more voltages in a row are below [`Levels::min`], without a failed conversion
    /// between them. The result is then the last state with its old time, a draw of 0, no dissipation, and the stage
    /// `Derated` or `Cutoff`. The result is `None` before the first plausible sample.
    ///
    /// A voltage above [`Levels::max`] enters the filter as [`Levels::max`]. Motors then draw nothing, and braking
    /// motors dissipate. If such a voltage were not plausible, a converter at the end of its range would make braking
    /// motors coast.
    pub fn step(&mut self, voltage: Option<Millivolts>, now: Micros) -> Option<Battery> {
        let battery = self.update(voltage, now);
        self.last_reading = BusReading::new(&self.limits, voltage, battery.as_ref(), now);
        battery
    }

    /// Returns the reading of the last step, plausible or not.
    pub const fn last_reading(&self) -> BusReading {
        self.last_reading
    }

    /// Does the work of [`step`](Self::step), but does not store the last reading.
    fn update(&mut self, voltage: Option<Millivolts>, now: Micros) -> Option<Battery> {
        match voltage {
            Some(measured) if measured >= self.limits.levels().min => Some(self.accept(measured, now)),
            _ => {
                (self.filtered_q8_mv, self.exceeded_at) = (None, None);
                let collapsed = voltage.is_some() && self.last_reading.state == BusState::TooLow;
                if !collapsed {
                    return None;
                }
                let last = self.last_battery?;
                let (stage, draw) = self.derating.draw_nothing_after_collapse();
                Some(Battery { stage, draw, dissipate: Share::NONE, ..last })
            }
        }
    }

    /// Updates filter and limits from a plausible voltage.
    fn accept(&mut self, measured: Millivolts, now: Micros) -> Battery {
        let Levels { max, .. } = self.limits.levels();
        let last = self.last_battery.filter(|_| self.filtered_q8_mv.is_some());
        let since_us = last.map_or(0, |last| now.since(last.at));
        let left_quiet = self.quiet().is_some_and(|quiet| !quiet.contains(&measured));
        let longest_us = if left_quiet { LEFT_QUIET_MICROS } else { u32::MAX };
        let passed_us = since_us.min(longest_us.into()) as u32;
        let newest = measured.min(max);
        let before = self.filtered_q8_mv.filter(|_| since_us <= BATTERY_STALE_MICROS);
        let filtered = filter(before, newest, passed_us);
        self.filtered_q8_mv = Some(filtered);
        let dissipate = overvoltage::step(&mut self.exceeded_at, &self.limits, last.as_ref(), measured, now);
        let (stage, draw) = self.derating.step(&self.limits, rounded(filtered), passed_us);
        let (stage, draw) =
            if measured > max { (DrawStage::Overvoltage, Share::NONE) } else { (stage, draw) };
        let battery = Battery { voltage: rounded(filtered), newest, at: now, stage, draw, dissipate };
        self.last_battery = Some(battery);
        battery
    }
}
