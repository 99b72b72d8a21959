//! Reports the limits of the supply, and the energy that braking motors have returned and dissipated.

use crate::braking::Returned;
use crate::supply::{Battery, DrawStage};
use crate::units::{Microjoules, Micros, Period, Share};

/// The bus after one tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bus {
    /// How far the supply limits the current that motors draw. [`DrawStage::Cut`] without a fresh state of the battery.
    pub stage: DrawStage,
    /// How strongly bridges dissipate the energy of braking motors. [`Share::NONE`] if the supply takes the energy.
    pub dissipate: Share,
    /// Energy that braking motors have returned to the bus since boot. It is computed from motor constants and bridge
    /// commands.
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
}

/// Longest time between two additions of energy, in ms. The power of a braking motor hardly changes in this time. At a
/// longer control period energy is added at each tick.
const INTERVAL_MS: u32 = 50;

/// Integrates the power of all braking motors.
#[derive(Clone, Copy, Debug)]
pub(super) struct EnergyMeter {
    /// Ticks between two regular additions. Energy is also added before direct actions and new limits of the bus change
    /// bridge commands.
    ticks: u32,
    /// Time of the last addition. `None` before the first addition.
    until: Option<Micros>,
    returned: Microjoules,
    dissipated: Microjoules,
}

impl EnergyMeter {
    /// Creates a meter for a hub that is stepped every `period`.
    pub(super) fn new(period: Period) -> Self {
        let ticks = (INTERVAL_MS / period.as_millis()).max(1);
        Self { ticks, until: None, returned: Microjoules::ZERO, dissipated: Microjoules::ZERO }
    }

    /// True if a regular addition is due at the tick with this number.
    pub(super) const fn is_due(&self, tick: u32) -> bool {
        tick.is_multiple_of(self.ticks)
    }

    /// Adds the energy since the last addition. The computation assumes the motors' present powers for the whole time.
    pub(super) fn add(&mut self, now: Micros, motors: impl Iterator<Item = Returned>) {
        let passed = self.until.map_or(0, |until| now.since(until)) as u32;
        self.until = self.until.max(Some(now));
        let (mut returned, mut dissipated) = (0.0, 0.0);
        for motor in motors {
            returned += motor.returned;
            dissipated += motor.dissipated;
        }
        // A watt is a microjoule per microsecond. The conversion to an integer saturates, and converts NaN to 0.
        let microjoules = |watts: f32| (watts * passed as f32) as u32;
        self.returned = self.returned.plus(microjoules(returned));
        self.dissipated = self.dissipated.plus(microjoules(dissipated));
    }

    /// Returns the report of the bus. `battery` is `None` without a fresh state of the battery.
    pub(super) fn report(&self, battery: Option<&Battery>) -> Bus {
        Bus {
            stage: battery.map_or(DrawStage::Cut, |battery| battery.stage),
            dissipate: battery.map_or(Share::NONE, |battery| battery.dissipate),
            returned: self.returned,
            dissipated: self.dissipated,
        }
    }
}
