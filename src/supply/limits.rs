//! The bus voltages at which the supply limits what motors may do.

use crate::units::{Millivolts, RangeError};

/// Voltages of the bus, in ascending order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Levels {
    /// Lowest plausible voltage. On a lower voltage motors draw no current, and coast once the last plausible reading is
    /// stale.
    pub min: Millivolts,
    /// At this voltage and below it no current may be drawn. Drawing resumes once the voltage is back at `derate`.
    pub cut: Millivolts,
    /// Below this voltage the battery counts as low. The current that may be drawn falls in proportion, to 0 at `cut`.
    pub derate: Millivolts,
    /// From this voltage on a low battery counts as recovered.
    pub recover: Millivolts,
    /// Above this voltage braking motors dissipate the energy that they would return to the bus.
    pub burn: Millivolts,
    /// Dissipating motors keep the bus below this voltage. Halfway from `burn` they draw the most current from the bus.
    pub burn_all: Millivolts,
    /// Highest plausible voltage. Above it no current may be drawn, and all returned energy is dissipated.
    pub max: Millivolts,
}

/// [`Levels`] that have been checked to ascend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits(Levels);

impl Limits {
    /// Checks that the levels ascend.
    ///
    /// # Errors
    /// [`RangeError::SupplyLevels`] unless min <= cut < derate <= recover < burn < `burn_all` <= max.
    pub const fn new(levels: Levels) -> Result<Self, RangeError> {
        let Levels { min, cut, derate, recover, burn, burn_all, max } = levels;
        let ascend = min.get() <= cut.get()
            && cut.get() < derate.get()
            && derate.get() <= recover.get()
            && recover.get() < burn.get()
            && burn.get() < burn_all.get()
            && burn_all.get() <= max.get();
        if ascend { Ok(Self(levels)) } else { Err(RangeError::SupplyLevels) }
    }

    /// Returns the levels.
    pub const fn levels(self) -> Levels {
        self.0
    }

    /// Limits of a 12 V battery.
    ///
    /// The battery is low below 7.0 V until it is back at 7.5 V, and cut at 6.0 V. Returned energy is dissipated above
    /// 14.0 V, which keeps the bus below 15.5 V. Plausible are 5 to 24 V: the operating range of VNH5019 bridges with
    /// a margin for noise (data sheet: 5.5 to 24 V; their absolute maximum is 41 V).
    pub const TWELVE_VOLTS: Self = Self(Levels {
        min: Millivolts::new(5_000),
        cut: Millivolts::new(6_000),
        derate: Millivolts::new(7_000),
        recover: Millivolts::new(7_500),
        burn: Millivolts::new(14_000),
        burn_all: Millivolts::new(15_500),
        max: Millivolts::new(24_000),
    });
}

impl Default for Limits {
    /// Returns [`Limits::TWELVE_VOLTS`].
    fn default() -> Self {
        Self::TWELVE_VOLTS
    }
}
