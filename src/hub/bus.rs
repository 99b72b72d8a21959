//! The bus in a snapshot: the limits of the supply, and the energy that braking motors have returned and dissipated.

use crate::braking::BrakingPower;
use crate::supply::{Battery, DrawStage};
use crate::units::{Microjoules, Share};

/// The bus after one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bus {
    /// Stage of the limit on the current that motors draw from the supply. [`DrawStage::Cut`] without a fresh state of
    /// the battery.
    pub stage: DrawStage,
    /// Strength with which braking motors dissipate their energy, as a share of full strength. [`Share::NONE`] while
    /// the supply takes the energy.
    pub dissipate: Share,
    /// Energy that braking motors have returned to the bus since boot. The hub computes the energy from motor constants
    /// and bridge commands.
    pub returned: Microjoules,
    /// Energy that braking motors have dissipated in windings and bridges since boot.
    pub dissipated: Microjoules,
}

impl Bus {
    /// The state before the first tick.
    pub const INITIAL: Self = Self {
        stage: DrawStage::Full,
        dissipate: Share::NONE,
        returned: Microjoules::ZERO,
        dissipated: Microjoules::ZERO,
    };

    /// Adds the energy of the last `passed_us` microseconds, in which the motors returned and dissipated these powers
    /// in watts.
    pub(super) fn add(&mut self, passed_us: u32, motors: impl Iterator<Item = BrakingPower>) {
        let (mut returned, mut dissipated) = (0.0, 0.0);
        for motor in motors {
            returned += motor.returned_watts;
            dissipated += motor.dissipated_watts;
        }
        // A watt is a microjoule per microsecond. The conversion to an integer saturates, and converts NaN to 0.
        let microjoules = |watts: f32| (watts * passed_us as f32) as u32;
        self.returned = self.returned.plus(microjoules(returned));
        self.dissipated = self.dissipated.plus(microjoules(dissipated));
    }

    /// Sets stage and dissipation. `battery` is `None` without a fresh state of the battery.
    pub(super) fn update(&mut self, battery: Option<&Battery>) {
        self.stage = battery.map_or(DrawStage::Cut, |battery| battery.stage);
        self.dissipate = battery.map_or(Share::NONE, |battery| battery.dissipate);
    }
}
