//! Limits of a motor's voltage. Every limit is an interval of volts. Each interval contains the back EMF, because at
//! this voltage no current flows. So the intervals of all limits have at least the back EMF in common.

use crate::units::Share;
use crate::units::single::{at_least, at_most};
use libm::sqrtf;

/// An interval of allowed voltages, in volts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct VoltageLimits {
    least: f32,
    most: f32,
}

impl VoltageLimits {
    /// Any voltage.
    pub(super) const NONE: Self = Self { least: f32::NEG_INFINITY, most: f32::INFINITY };

    /// Limits the current in either direction, driving or braking.
    pub(super) const fn by_current(emf: f32, amperes: f32, ohms: f32) -> Self {
        Self { least: emf - amperes * ohms, most: emf + amperes * ohms }
    }

    /// Limits the current that drives the motor. Braking up to a short circuit of the winding is not limited, because a
    /// load that falls does more harm than a hot winding. Reverse driving is limited to `amperes` or to the current of
    /// the short circuit, whichever is higher.
    pub(super) const fn by_driving_current(emf: f32, amperes: f32, ohms: f32) -> Self {
        let Self { least, most } = Self::by_current(emf, amperes, ohms);
        Self { least: at_most(least, 0.0), most: at_least(most, 0.0) }
    }

    /// Limits the power from the battery to this share of `battery² / R`, the power at standstill with full voltage. At
    /// a motor voltage v the bridge draws the power `v (v - emf) / R`. With the share 0 the motor may only brake or
    /// coast.
    pub(super) fn by_draw(emf: f32, battery: f32, share: Share) -> Self {
        if share == Share::ALL {
            return Self::NONE;
        }
        let root = sqrtf(emf * emf + 4.0 * share.to_f32() * battery * battery);
        Self { least: (emf - root) / 2.0, most: (emf + root) / 2.0 }
    }

    /// The voltages that both limits allow. Both limits contain the back EMF, so the result is not empty.
    pub(super) const fn and(self, other: Self) -> Self {
        Self { least: at_least(self.least, other.least), most: at_most(self.most, other.most) }
    }

    /// The highest allowed voltage.
    pub(super) const fn most(self) -> f32 {
        self.most
    }

    /// The allowed voltage that is nearest to `volts`.
    pub(super) const fn clamp(self, volts: f32) -> f32 {
        at_most(at_least(volts, self.least), self.most)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_power_is_drawn_than_the_share() {
        for emf in [-9.0, -2.0, 0.0, 6.0, 11.0] {
            for percent in [0, 1, 20, 70, 99] {
                let share = Share::from_f32(percent as f32 / 100.0);
                let limits = VoltageLimits::by_draw(emf, 12.0, share);
                for volts in [limits.least, limits.most] {
                    let drawn = volts * (volts - emf) / 144.0;
                    assert!((drawn - share.to_f32()).abs() < 1e-4, "{emf} V, {percent} %: {drawn}");
                }
            }
        }
    }

    #[test]
    fn without_any_power_to_draw_a_motor_may_brake_and_coast() {
        for (emf, limits) in [(6.0, (0.0, 6.0)), (-6.0, (-6.0, 0.0))] {
            let VoltageLimits { least, most } = VoltageLimits::by_draw(emf, 12.0, Share::NONE);
            assert_eq!((least, most), limits);
        }
    }

    #[test]
    fn a_limit_of_the_driving_current_leaves_all_braking() {
        let limits = VoltageLimits::by_driving_current(9.0, 1.0, 3.0);
        assert_eq!([-5.0, 2.0, 9.0, 14.0].map(|volts| limits.clamp(volts)), [0.0, 2.0, 9.0, 12.0]);
        let limits = VoltageLimits::by_current(9.0, 1.0, 3.0);
        assert_eq!([-5.0, 2.0, 9.0, 14.0].map(|volts| limits.clamp(volts)), [6.0, 6.0, 9.0, 12.0]);
    }

    #[test]
    fn all_limits_together_allow_the_back_emf() {
        for emf in [-20.0, -3.0, 0.0, 3.0, 20.0] {
            let limits = VoltageLimits::by_current(emf, 0.1, 2.0)
                .and(VoltageLimits::by_driving_current(emf, 0.2, 2.0))
                .and(VoltageLimits::by_draw(emf, 12.0, Share::NONE));
            assert!((limits.clamp(emf) - emf).abs() < 1e-5, "{emf} V: {limits:?}");
        }
    }
}
