//! The bus that battery and bridges share: filters the measured voltage and decides what motors may draw and return.
//!
//! ```text
//!        min       cut        derate     recover       burn       burn_all       max
//!  -------+---------+-----------+----------+------------+------------+------------+-----> bus voltage
//!   coast |   Cut   |  Derated  |  Full or |    Full    | Full, returned energy   |  Cut, returned energy
//!         | draws 0 | draws 0-1 |  Derated |  draws all | is dissipated           |  is dissipated
//! ```
//!
//! * Between `derate` and `recover` the stage depends on the past (hysteresis). Below `derate`, `Cut` lasts until the
//!   voltage is back at `derate`. See [`Stage`].
//! * The *draw* is a share of the current that motors draw from the bus at standstill and full duty.
//! * *Burning* means that braking motors dissipate the energy that they would return to the bus. The bridges alternate
//!   between a full short and driving slightly above the back EMF.
//!
//! [`VrefintScale`] converts readings of chips that read their own reference beside the battery to millivolts. Boards
//! with another converter bring their own conversion.
//!
//! ```
//! use motor_hub::supply::{Limits, Stage, Supply};
//! use motor_hub::units::{Micros, Millivolts};
//!
//! let mut supply = Supply::new(Limits::default());
//! let battery = supply.step(Some(Millivolts::new(12_000)), Micros::new(10_000)).expect("plausible");
//! assert_eq!((battery.voltage, battery.stage), (Millivolts::new(12_000), Stage::Full));
//! assert_eq!(supply.step(Some(Millivolts::new(3_000)), Micros::new(20_000)), None);
//! ```

mod bus_state;
mod limits;
mod overvoltage;
mod undervoltage;
mod vrefint;

pub use bus_state::{BusReading, BusState};
pub use limits::{Levels, Limits};
pub use undervoltage::Stage;
pub use vrefint::{VrefintCalibration, VrefintSample, VrefintScale};

use crate::units::{Micros, Millivolts, Share};
use core::ops::RangeInclusive;
use overvoltage::Overvoltage;
use undervoltage::Derating;

/// Age in microseconds beyond which a battery reading is stale. After a longer gap between samples the filter restarts.
pub const BATTERY_STALE_MICROS: u64 = 100_000;

/// Time constant of the voltage filter, in microseconds. One sampling interval adds to the time constant.
const FILTER_MICROS: f32 = 30_000.0;

/// Longest interval in microseconds that the filter assumes before the first sample outside the quiet range. Quiet
/// samples are up to 10 ms apart, but the bus has left the quiet range only just before that sample.
const LEFT_QUIET_MICROS: u32 = 1_000;

/// State of the bus, and when the bus was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Battery {
    /// Filtered voltage.
    pub voltage: Millivolts,
    /// Voltage of the newest sample, at most [`Levels::max`].
    pub newest: Millivolts,
    /// Time of the newest sample.
    pub at: Micros,
    /// Stage of the undervoltage protection.
    pub stage: Stage,
    /// Current that may be drawn, as a share of what motors draw at standstill and full duty.
    pub draw: Share,
    /// How strongly braking motors must dissipate energy. Depends on the newest sample, not on the filtered voltage.
    pub burn: Share,
}

impl Battery {
    /// Creates a state in which the supply limits nothing.
    pub const fn good(voltage: Millivolts, at: Micros) -> Self {
        Self { voltage, newest: voltage, at, stage: Stage::Full, draw: Share::ALL, burn: Share::NONE }
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
    /// Voltage filter; `None` before the first plausible sample and after an implausible one.
    filter: Option<Filter>,
    derating: Derating,
    overvoltage: Overvoltage,
    /// Result of the last plausible sample; `None` since the converter last failed to answer.
    last_battery: Option<Battery>,
    /// The last reading, plausible or not.
    last_reading: BusReading,
}

/// First-order low-pass filter of the voltage.
///
/// The weight of a sample is computed in single precision, because some chips have no fast 64-bit division.
#[derive(Clone, Copy, Debug)]
struct Filter {
    /// Filtered voltage in steps of 2^-8 mV.
    value_q8_mv: i32,
    /// Time of the last sample.
    at: Micros,
}

impl Filter {
    /// Takes a sample with the weight dt / (dt + 30 ms), where dt is `passed_us`. The first sample, and a sample after
    /// a gap of more than [`BATTERY_STALE_MICROS`], set the filter.
    fn step(before: Option<Self>, voltage: Millivolts, at: Micros, passed_us: u32) -> Self {
        let new = i32::from(voltage.get()) << 8;
        let value_q8_mv = match before {
            Some(Self { value_q8_mv, at: last }) if at.since(last) <= BATTERY_STALE_MICROS => {
                let weight = passed_us as f32 / (passed_us as f32 + FILTER_MICROS);
                value_q8_mv + ((new - value_q8_mv) as f32 * weight) as i32
            }
            _ => new,
        };
        Self { value_q8_mv, at }
    }

    /// Returns the filtered voltage, rounded. All samples fit in 16 bits, hence their mean does too.
    fn voltage(self) -> Millivolts {
        Millivolts::new(((self.value_q8_mv + 128) >> 8) as u16)
    }
}

impl Supply {
    /// Creates a supply that has measured no voltage yet.
    pub const fn new(limits: Limits) -> Self {
        Self {
            limits,
            filter: None,
            derating: Derating::INITIAL,
            overvoltage: Overvoltage::IDLE,
            last_battery: None,
            last_reading: BusReading::NOTHING,
        }
    }

    /// Returns the voltages between which the limits of the motors do not change. While the bus stays between them,
    /// only the filter needs samples. `None` if the bus must be sampled every millisecond.
    pub fn quiet(&self) -> Option<RangeInclusive<Millivolts>> {
        let Levels { derate, burn, .. } = self.limits.levels();
        let filtered = self.filter?.voltage();
        let unlimited = self.derating.allows_all() && !self.overvoltage.is_active() && filtered >= derate;
        unlimited.then_some(derate..=burn)
    }

    /// Takes a measured voltage: every millisecond, or less often while the bus is [quiet](Self::quiet).
    ///
    /// `voltage` is `None` if the converter did not answer. The result is `None` if there is no voltage, or if it is
    /// implausibly low. The next plausible sample restarts the filter.
    ///
    /// A second implausibly low sample in a row means that the bus collapses. The result is then the last state, with
    /// its old time and without any current to draw.
    ///
    /// A voltage above [`Levels::max`] counts as plausible, limited to that level. A converter at the end of its range
    /// must not release a braking motor.
    ///
    /// The filter is of first order. Its time constant is 30 ms plus one sampling interval. For the first sample outside
    /// the quiet range the interval is limited to 1 ms.
    pub fn step(&mut self, voltage: Option<Millivolts>, now: Micros) -> Option<Battery> {
        let battery = self.update(voltage, now);
        self.last_reading = BusReading::new(&self.limits, voltage, battery.as_ref(), now);
        battery
    }

    /// Returns the reading of the last step, plausible or not.
    pub const fn seen(&self) -> BusReading {
        self.last_reading
    }

    /// Checks whether a voltage is plausible, and derives the state from it.
    fn update(&mut self, voltage: Option<Millivolts>, now: Micros) -> Option<Battery> {
        match voltage {
            Some(measured) if measured >= self.limits.levels().min => Some(self.accept(measured, now)),
            _ => {
                let collapses = voltage.is_some() && self.filter.is_none();
                self.filter = None;
                self.overvoltage = Overvoltage::IDLE;
                if voltage.is_none() {
                    self.last_battery = None;
                }
                self.last_battery.filter(|_| collapses).map(|last| {
                    let (stage, draw) = self.derating.cut_after_collapse();
                    Battery { stage, draw, burn: Share::NONE, ..last }
                })
            }
        }
    }

    /// Takes a plausible voltage.
    fn accept(&mut self, measured: Millivolts, now: Micros) -> Battery {
        let Levels { max, .. } = self.limits.levels();
        let since_us =
            self.filter.map_or(0, |filter| u32::try_from(now.since(filter.at)).unwrap_or(u32::MAX));
        let left_quiet = self.quiet().is_some_and(|quiet| !quiet.contains(&measured));
        let passed_us = if left_quiet { since_us.min(LEFT_QUIET_MICROS) } else { since_us };
        let newest = measured.min(max);
        let filter = Filter::step(self.filter, newest, now, passed_us);
        self.filter = Some(filter);
        let burn = self.overvoltage.step(&self.limits, measured, now);
        let (stage, draw) = self.derating.step(&self.limits, filter.voltage(), passed_us);
        let (stage, draw) = if measured > max { (Stage::Cut, Share::NONE) } else { (stage, draw) };
        let battery = Battery { voltage: filter.voltage(), newest, at: now, stage, draw, burn };
        self.last_battery = Some(battery);
        battery
    }
}
