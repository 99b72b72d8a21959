//! The bus voltages at which the supply begins and ends to limit motors.

use crate::units::{Millivolts, RangeError};

/// Voltages of the bus, in ascending order. Voltages that [`Limits::new`] compares with `<=` may be equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Levels {
    /// Lowest plausible voltage. After two lower voltages in a row motors draw no current. Motors coast once the last
    /// plausible reading is stale.
    pub min: Millivolts,
    /// From this voltage downwards motors may draw no current. Motors may draw current again once the voltage is back
    /// at `derate`.
    pub cutoff: Millivolts,
    /// Voltage below which the battery counts as low. The permitted current falls linearly from `derate` to 0 at `cutoff`.
    pub derate: Millivolts,
    /// Voltage at which a low battery counts as recovered.
    pub recover: Millivolts,
    /// Voltage above which braking motors dissipate the energy that they would return to the bus.
    pub dissipate: Millivolts,
    /// Voltage that the bus does not exceed while motors dissipate, unless another source raises the voltage. Motors
    /// dissipate with full strength from halfway between `dissipate` and this voltage.
    pub ceiling: Millivolts,
    /// Highest voltage of the operating range. A higher voltage enters the filter as this voltage. Motors then draw no
    /// current, and braking motors dissipate all energy.
    pub max: Millivolts,
}

/// [`Levels`] that have been checked to ascend.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Limits(Levels);

impl Limits {
    /// Creates limits from levels that ascend.
    ///
    /// # Errors
    /// [`RangeError::SupplyLevels`] unless min <= cutoff < derate <= recover < dissipate < `ceiling` <= max.
    pub const fn new(levels: Levels) -> Result<Self, RangeError> {
        let Levels { min, cutoff, derate, recover, dissipate, ceiling, max } = levels;
        let ascend = min.get() <= cutoff.get()
            && cutoff.get() < derate.get()
            && derate.get() <= recover.get()
            && recover.get() < dissipate.get()
            && dissipate.get() < ceiling.get()
            && ceiling.get() <= max.get();
        if ascend { Ok(Self(levels)) } else { Err(RangeError::SupplyLevels) }
    }

    /// Returns the checked levels.
    pub const fn levels(self) -> Levels {
        self.0
    }

    /// Limits of a 12 V battery on VNH5019 bridges.
    ///
    /// `min` and `max` are the ends of the bridges' operating range (data sheet: 5.5 to 24 V), with a margin of 0.5 V
    /// for noise at the lower end. The bridges' absolute maximum is 41 V.
    pub const TWELVE_VOLTS: Self = Self(Levels {
        min: Millivolts::new(5_000),
        cutoff: Millivolts::new(6_000),
        derate: Millivolts::new(7_000),
        recover: Millivolts::new(7_500),
        dissipate: Millivolts::new(14_000),
        ceiling: Millivolts::new(15_500),
        max: Millivolts::new(24_000),
    });
}

impl Default for Limits {
    /// Returns [`Limits::TWELVE_VOLTS`].
    fn default() -> Self {
        Self::TWELVE_VOLTS
    }
}
