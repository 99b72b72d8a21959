//! The bus as a host would want to see it: what it allows, and what braking motors did with their energy.

use crate::braking::Returned;
use crate::supply::{Battery, Stage};
use crate::units::{Microjoules, Micros, Period, Share};

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

/// Ticks that are closer than this are not added up one by one: drives hardly change from one to the next.
const INTERVAL_MS: u32 = 50;

/// Adds up.
#[derive(Clone, Copy, Debug)]
pub(super) struct Account {
    /// Ticks from one entry to the next; changes of what the supply allows have entries of their own.
    ticks: u32,
    until: Option<Micros>,
    returned: Microjoules,
    burnt: Microjoules,
}

impl Account {
    pub(super) fn new(period: Period) -> Self {
        let ticks = (INTERVAL_MS / period.as_millis()).max(1);
        Self { ticks, until: None, returned: Microjoules::ZERO, burnt: Microjoules::ZERO }
    }

    pub(super) const fn is_due(&self, tick: u32) -> bool {
        tick.is_multiple_of(self.ticks)
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
