//! The bus that battery and bridges share: what a board's converter measured, as filtered millivolts while it is
//! plausible, and what that allows the motors to do.
//!
//! ```text
//!  min      cut        derate  recover          burn     burn_all        max
//!   |        |            |       |               |          |            |
//!   | nothing is drawn    |       | all as asked  | returned energy is    |
//!   |        | ever less  |.......| (hysteresis)  | burnt, more is drawn  | nothing is drawn, all is burnt
//! ```
//!
//! Boards whose chip reads its own reference beside the battery have [`VrefintScale`] for the first step;
//! others bring millivolts of their own.
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

mod limits;
mod overvoltage;
mod seen;
mod undervoltage;
mod vrefint;

pub use limits::{Levels, Limits};
pub use seen::{BusState, Seen};
pub use undervoltage::Stage;
pub use vrefint::{VrefintCalibration, VrefintSample, VrefintScale};

use crate::units::{Micros, Millivolts, Share};
use core::ops::RangeInclusive;
use overvoltage::Burning;
use undervoltage::Derating;

/// A battery reading older than this is none; so long a silence is not bridged by the filter either.
pub const BATTERY_STALE_MICROS: u64 = 100_000;

/// Of the filter, less the interval between two samples.
const FILTER_MICROS: f32 = 30_000.0;

/// A bus that leaves the quiet voltages is looked at after so long.
const LEFT_MICROS: u32 = 1_000;

/// What is known of the bus, and when it was measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Battery {
    /// Filtered.
    pub voltage: Millivolts,
    /// The newest sample.
    pub newest: Millivolts,
    /// When the newest sample in it was taken.
    pub at: Micros,
    /// How much may be drawn, in words;
    pub stage: Stage,
    /// and as a share of what the motors would draw at standstill.
    pub draw: Share,
    /// How far bridges are to burn what braking motors return: by the newest sample, not by the filter.
    pub burn: Share,
}

impl Battery {
    /// A voltage at which motors may do all that they are asked to.
    pub const fn good(voltage: Millivolts, at: Micros) -> Self {
        Self { voltage, newest: voltage, at, stage: Stage::Full, draw: Share::ALL, burn: Share::NONE }
    }

    /// True unless it is older than [`BATTERY_STALE_MICROS`].
    pub const fn is_fresh(&self, now: Micros) -> bool {
        now.since(self.at) <= BATTERY_STALE_MICROS
    }
}

/// Judges and filters.
#[derive(Clone, Debug)]
pub struct Supply {
    limits: Limits,
    /// `None` before the first good reading and after a bad one.
    filter: Option<Filter>,
    derating: Derating,
    burning: Burning,
    /// What was last known, since the converter answers.
    newest: Option<Battery>,
    seen: Seen,
}

/// Of first order. (Its weight in single precision: a division of 64 bits takes some chips as long as all the rest.)
#[derive(Clone, Copy, Debug)]
struct Filter {
    /// In steps of 2^-8 mV.
    value: i32,
    at: Micros,
}

impl Filter {
    /// The shorter a voltage has been there, in microseconds, the less it counts. After a silence, and at first, it is
    /// all that counts.
    fn step(before: Option<Self>, voltage: Millivolts, at: Micros, passed: u32) -> Self {
        let new = i32::from(voltage.get()) << 8;
        let value = match before {
            Some(Self { value, at: last }) if at.since(last) <= BATTERY_STALE_MICROS => {
                let weight = passed as f32 / (passed as f32 + FILTER_MICROS);
                value + ((new - value) as f32 * weight) as i32
            }
            _ => new,
        };
        Self { value, at }
    }

    /// Within the limits like everything it is made of, hence within 16 bits.
    fn voltage(self) -> Millivolts {
        Millivolts::new(((self.value + 128) >> 8) as u16)
    }
}

impl Supply {
    /// Knows no voltage yet.
    pub const fn new(limits: Limits) -> Self {
        Self {
            limits,
            filter: None,
            derating: Derating::NEW,
            burning: Burning::NEW,
            newest: None,
            seen: Seen::NOTHING,
        }
    }

    /// The voltages among which nothing changes for the motors, while that is so: until the bus leaves them it need
    /// not be looked at but for the filter's sake. `None` if it is to be looked at every millisecond.
    pub fn quiet(&self) -> Option<RangeInclusive<Millivolts>> {
        let Levels { derate, burn, .. } = self.limits.levels();
        let filtered = self.filter?.voltage();
        let all_allowed = self.derating.is_over() && !self.burning.is_on() && filtered >= derate;
        all_allowed.then_some(derate..=burn)
    }

    /// Takes a measured voltage, every millisecond unless the bus is [quiet](Self::quiet); `None` if there is none or
    /// it is implausibly low. The one after that starts the filter afresh, and so does one after a silence of
    /// [`BATTERY_STALE_MICROS`]. What is above the highest plausible voltage counts as that: a converter that
    /// reads no further is no reason to let go of a motor that brakes.
    ///
    /// A second implausibly low one in a row is a bus that breaks down: nothing is drawn from it, and what was known
    /// of it becomes no newer.
    ///
    /// The filter is of first order with a time constant of 30 ms and an interval between two samples. One that leaves
    /// the quiet voltages counts as a millisecond after the one before.
    pub fn step(&mut self, voltage: Option<Millivolts>, now: Micros) -> Option<Battery> {
        let battery = self.judge(voltage, now);
        self.seen = Seen::new(&self.limits, voltage, battery.as_ref(), now);
        battery
    }

    /// What was seen at the last step, plausible or not.
    pub const fn seen(&self) -> Seen {
        self.seen
    }

    fn judge(&mut self, voltage: Option<Millivolts>, now: Micros) -> Option<Battery> {
        match voltage {
            Some(measured) if measured >= self.limits.levels().min => Some(self.take(measured, now)),
            _ => {
                let breaks_down = voltage.is_some() && self.filter.is_none();
                self.filter = None;
                self.burning = Burning::NEW;
                if voltage.is_none() {
                    self.newest = None;
                }
                self.newest.filter(|_| breaks_down).map(|known| {
                    let (stage, draw) = self.derating.break_down();
                    Battery { stage, draw, burn: Share::NONE, ..known }
                })
            }
        }
    }

    /// A plausible one.
    fn take(&mut self, measured: Millivolts, now: Micros) -> Battery {
        let Levels { max, .. } = self.limits.levels();
        let since = self.filter.map_or(0, |filter| u32::try_from(now.since(filter.at)).unwrap_or(u32::MAX));
        // A bus that has left the quiet voltages has only just done so.
        let left = self.quiet().is_some_and(|quiet| !quiet.contains(&measured));
        let passed = if left { since.min(LEFT_MICROS) } else { since };
        let newest = measured.min(max);
        let filter = Filter::step(self.filter, newest, now, passed);
        self.filter = Some(filter);
        let burn = self.burning.step(&self.limits, measured, now);
        let (stage, draw) = self.derating.step(&self.limits, filter.voltage(), passed);
        let (stage, draw) = if measured > max { (Stage::Cut, Share::NONE) } else { (stage, draw) };
        let battery = Battery { voltage: filter.voltage(), newest, at: now, stage, draw, burn };
        self.newest = Some(battery);
        battery
    }
}
