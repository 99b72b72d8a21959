//! The bus as a host would want to see it: what it allows, and what braking motors did with their energy.

use crate::braking::Returned;
use crate::supply::{Battery, Stage};
use crate::units::{Microjoules, Micros, Share};

/// The bus as of one tick. None of it is a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Bus {
    /// How much may be drawn.
    pub stage: Stage,
    /// How far bridges burn what braking motors would return; [`Share::NONE`] on a supply that takes it.
    pub burn: Share,
    /// What braking motors have returned to the bus since boot, by their constants and what the bridges are told.
    pub returned: Microjoules,
    /// What they have burnt in windings and bridges meanwhile.
    pub burnt: Microjoules,
}

impl Bus {
    /// Before the first tick.
    pub const INITIAL: Self =
        Self { stage: Stage::Full, burn: Share::NONE, returned: Microjoules::ZERO, burnt: Microjoules::ZERO };
}

/// Nothing is added up more often than this but at changes of what the supply allows: the usual control period.
const LONGEST_MICROS: u64 = 50_000;

/// Adds up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Account {
    until: Option<Micros>,
    returned: Microjoules,
    burnt: Microjoules,
}

impl Account {
    pub(super) const NEW: Self = Self { until: None, returned: Microjoules::ZERO, burnt: Microjoules::ZERO };

    /// Long enough ago for a motor to have another speed.
    pub(super) fn is_due(&self, now: Micros) -> bool {
        self.until.is_none_or(|until| now.since(until) >= LONGEST_MICROS)
    }

    /// So it went on until now.
    pub(super) fn settle(&mut self, now: Micros, motors: impl Iterator<Item = Returned>) {
        let passed = self.until.map_or(0, |until| now.since(until)) as u32;
        self.until = self.until.max(Some(now));
        let (mut returned, mut burnt) = (0.0, 0.0);
        for motor in motors {
            returned += motor.returned;
            burnt += motor.burnt;
        }
        // Watts by microseconds; saturating in the conversion, and no number is none.
        let microjoules = |watts: f32| (watts * passed as f32) as u32;
        self.returned = self.returned.plus(microjoules(returned));
        self.burnt = self.burnt.plus(microjoules(burnt));
    }

    pub(super) fn report(&self, battery: Option<&Battery>) -> Bus {
        Bus {
            stage: battery.map_or(Stage::Cut, |battery| battery.stage),
            burn: battery.map_or(Share::NONE, |battery| battery.burn),
            returned: self.returned,
            burnt: self.burnt,
        }
    }
}
