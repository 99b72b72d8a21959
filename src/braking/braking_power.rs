//! Power of a braking motor. One part returns to the supply bus, the rest heats winding and bridge.

use super::points::{OperatingPoint, Regime};
use super::{Modulation, Modulator, clockwise_volts};

/// The two parts of the power of a braking motor, each at least 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct BrakingPower {
    /// Power that returns to the bus, in W.
    pub returned_watts: f32,
    /// Power that winding and bridge dissipate, in W.
    pub dissipated_watts: f32,
}

impl BrakingPower {
    /// The power of a motor that does not brake.
    pub const NONE: Self = Self { returned_watts: 0.0, dissipated_watts: 0.0 };
}

impl Modulator {
    /// Computes the braking power of a command. `ohms` is the resistance of winding and bridge.
    pub fn braking_power(&self, at: OperatingPoint, command: Modulation, ohms: f32) -> BrakingPower {
        let Modulation { drive, voltage, .. } = command;
        let (e, v) = at.volts();
        let current = (e - clockwise_volts(at, voltage)).max(0.0) / ohms;
        let braked = e * current;
        match at.regime(drive) {
            Regime::Forward => BrakingPower::NONE,
            Regime::Reverse => BrakingPower { returned_watts: 0.0, dissipated_watts: braked },
            Regime::Braking => {
                // Current flows into the bus only while the bridge is open. `share` is the part of the mean current
                // that flows in this time. If the current is continuous, `share` is the open share of the period. If
                // the current is discontinuous, the current rises and falls between 0 and the same peak, so `share` is
                // e / falling voltage.
                let open = 1.0 - drive.duty.to_f32();
                let share = open.min(e / self.current.falling_volts(v));
                let returned = (v * current * share).min(braked);
                BrakingPower { returned_watts: returned, dissipated_watts: braked - returned }
            }
        }
    }
}
