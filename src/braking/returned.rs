//! Power of a braking motor. One part returns to the supply bus, the rest heats winding and bridge.

use super::points::{OperatingPoint, Regime};
use super::{Modulator, clockwise_volts};
use crate::bridge::Drive;
use crate::units::Voltage;

/// The two parts of the power of a braking motor, in W, each at least 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Returned {
    /// Power that returns to the bus.
    pub returned: f32,
    /// Power that winding and bridge dissipate.
    pub dissipated: f32,
}

impl Returned {
    /// The power of a motor that does not brake.
    pub const NONE: Self = Self { returned: 0.0, dissipated: 0.0 };
}

impl Modulator {
    /// Computes the braking power while the command `drive` applies the voltage `applied`. `ohms` is the resistance of
    /// winding and bridge.
    pub fn returned(&self, at: OperatingPoint, drive: Drive, applied: Voltage, ohms: f32) -> Returned {
        let (e, v) = at.volts();
        let current = (e - clockwise_volts(at, applied)).max(0.0) / ohms;
        let braked = e * current;
        match at.regime(drive) {
            Regime::Forward => Returned::NONE,
            Regime::Reverse => Returned { returned: 0.0, dissipated: braked },
            Regime::Braking => {
                // Current flows into the bus only in the off time, in which the current falls. `share` is this part of
                // the mean current. A continuous current falls during the whole off time. A discontinuous current
                // reaches zero earlier. The voltage e raises the current in the on time, and the falling voltage less e
                // lowers it in the off time. The fall then carries the part e / falling voltage of the charge.
                let open = 1.0 - drive.duty.to_f32();
                let share = open.min(e / self.current.falling_volts(v));
                let returned = (v * current * share).min(braked);
                Returned { returned, dissipated: braked - returned }
            }
        }
    }
}
