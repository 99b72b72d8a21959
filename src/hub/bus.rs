//! Reports the bus: the limits of the supply, and the energy that braking motors returned and dissipated.

use crate::braking::Returned;
use crate::supply::{Battery, Stage};
use crate::units::{Microjoules, Micros, Period, Share};

/// The bus after one tick. None of its values is a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bus {
    /// Stage of the supply: it limits how much motors may draw.
    pub stage: Stage,
    /// How strongly bridges dissipate the energy of braking motors; [`Share::NONE`] on a supply that takes the energy.
    pub burn: Share,
    /// Energy that braking motors have returned to the bus since boot, computed from motor constants and bridge
    /// commands.
    pub returned: Microjoules,
    /// Energy that braking motors have dissipated in windings and bridges since boot.
    pub burnt: Microjoules,
}

impl Bus {
    /// The state before the first tick.
    pub const INITIAL: Self =
        Self { stage: Stage::Full, burn: Share::NONE, returned: Microjoules::ZERO, burnt: Microjoules::ZERO };
}

/// Time from one addition of energy to the next, in ms. Within it the drive of a motor hardly changes.
const INTERVAL_MS: u32 = 50;

/// Adds up the energy of all braking motors.
#[derive(Clone, Copy, Debug)]
pub(super) struct EnergyMeter {
    /// Ticks from one regular addition to the next. A change of the supply's limits makes an addition of its own.
    ticks: u32,
    /// Time up to which energy is added; `None` before the first addition.
    until: Option<Micros>,
    returned: Microjoules,
    burnt: Microjoules,
}

impl EnergyMeter {
    /// Creates a meter for a hub that is stepped every `period`.
    pub(super) fn new(period: Period) -> Self {
        let ticks = (INTERVAL_MS / period.as_millis()).max(1);
        Self { ticks, until: None, returned: Microjoules::ZERO, burnt: Microjoules::ZERO }
    }

    /// True if a regular addition is due at the tick of this number.
    pub(super) const fn is_due(&self, tick: u32) -> bool {
        tick.is_multiple_of(self.ticks)
    }

    /// Adds the energy of all motors up to now, at their present powers.
    pub(super) fn add(&mut self, now: Micros, motors: impl Iterator<Item = Returned>) {
        let passed = self.until.map_or(0, |until| now.since(until)) as u32;
        self.until = self.until.max(Some(now));
        let (mut returned, mut burnt) = (0.0, 0.0);
        for motor in motors {
            returned += motor.returned;
            burnt += motor.burnt;
        }
        // Watts times microseconds. The conversion saturates, and makes 0 of NaN.
        let microjoules = |watts: f32| (watts * passed as f32) as u32;
        self.returned = self.returned.plus(microjoules(returned));
        self.burnt = self.burnt.plus(microjoules(burnt));
    }

    /// The report of the bus; `battery` is `None` without a fresh reading.
    pub(super) fn report(&self, battery: Option<&Battery>) -> Bus {
        Bus {
            stage: battery.map_or(Stage::Cut, |battery| battery.stage),
            burn: battery.map_or(Share::NONE, |battery| battery.burn),
            returned: self.returned,
            burnt: self.burnt,
        }
    }
}
