//! The voltages at which the supply changes what motors may do.

use crate::units::{Millivolts, RangeError};

/// Voltages of the bus, ascending.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Levels {
    /// Lowest plausible voltage.
    pub min: Millivolts,
    /// Here and below nothing is drawn, until the voltage is back at `derate`.
    pub cut: Millivolts,
    /// Below this less may be drawn, in proportion, and the battery is low,
    pub derate: Millivolts,
    /// until it is back here.
    pub recover: Millivolts,
    /// From here on braking motors burn what they would return, and take the more from the bus the higher it is,
    pub burn: Millivolts,
    /// for it to stay below this.
    pub burn_all: Millivolts,
    /// Highest plausible voltage. Above it nothing is drawn, and all is burnt.
    pub max: Millivolts,
}

/// [`Levels`] that make sense.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits(Levels);

impl Limits {
    /// Checks.
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

    /// As they were given.
    pub const fn levels(self) -> Levels {
        self.0
    }

    /// Of a 12 V battery: low below 7.0 V until 7.5 V, cut at 6.0 V; returned energy is burnt from 14.0 V on,
    /// for the bus to stay below 15.5 V. Plausible is what bridges of the VNH5019 kind may work at, but for some noise: 5 to
    /// 24 V (data sheet: 5.5 to 24 V; they stand 41 V).
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
    /// [`Limits::TWELVE_VOLTS`].
    fn default() -> Self {
        Self::TWELVE_VOLTS
    }
}
