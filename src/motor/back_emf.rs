//! Corrects a configured back EMF constant that is too high for the motor.
//!
//! Magnets lose some 0.2 % of their field a kelvin, so a warm motor has less back EMF than a cold motor. While the
//! speed [hunts](crate::regulator::Output::hunts), the constant in force is lowered in steps, down to the largest
//! correction. The constant is not raised again before another back EMF or other dynamics are configured.

use crate::settings::{Dynamics, Settings};
use crate::units::{DecayRate, EmfConstant};

/// Step of the constant in force, in % of the configured constant.
const STEP_PERCENT: i32 = 1;
/// Largest correction, in % of the configured constant. The magnets of a motor lose that much in 75 K.
const LARGEST_PERCENT: i32 = 15;

/// The configured back EMF constant and dynamics. The motor's settings have the values in force, which may be lower.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Configured {
    emf: EmfConstant,
    dynamics: Option<Dynamics>,
}

impl Configured {
    /// Takes the configured values from settings that are not corrected.
    pub(super) const fn new(settings: &Settings) -> Self {
        Self { emf: settings.winding.emf, dynamics: settings.dynamics }
    }

    /// The settings in force with the back EMF constant lowered by one step; `None` if the correction has reached its
    /// limit.
    pub(super) fn lowered(&self, in_force: &Settings) -> Option<Settings> {
        let percent = self.emf.to_bits() / 100;
        let bits = in_force.winding.emf.to_bits() - STEP_PERCENT * percent;
        if bits < self.emf.to_bits() - LARGEST_PERCENT * percent {
            return None;
        }
        let mut settings = *in_force;
        settings.winding.emf = EmfConstant::from_bits(bits).ok()?;
        if let Some(dynamics) = &mut settings.dynamics {
            // The share of back EMF in the decay falls with the constant. The share of drag stays.
            let less = in_force.winding.emf.to_volts() - settings.winding.emf.to_volts();
            let steps = (65_536.0 * dynamics.gain.to_f32() * less) as u32;
            dynamics.decay = DecayRate::from_bits(dynamics.decay.to_bits().saturating_sub(steps));
        }
        Some(settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::braking::Winding;
    use crate::units::{AccelerationPerVolt, Millivolts};

    #[test]
    fn the_back_emf_is_lowered_by_at_most_15_percent_and_the_drag_stays() {
        let mut settings = Settings::new(Winding::NEVEREST_60);
        settings.dynamics = Some(Dynamics {
            gain: AccelerationPerVolt::from_f64(2_000.0).unwrap_or_else(|error| unreachable!("{error}")),
            decay: DecayRate::from_f64(9.0).unwrap_or_else(|error| unreachable!("{error}")),
            friction: Millivolts::new(0),
        });
        let configured = Configured::new(&settings);
        let emf = settings.winding.emf.to_volts();
        let drag = |settings: &Settings| {
            settings.dynamics.map_or(f32::NAN, |dynamics| {
                dynamics.decay.to_f32() - dynamics.gain.to_f32() * settings.winding.emf.to_volts()
            })
        };
        let before = drag(&settings);
        let mut steps = 0;
        while let Some(lowered) = configured.lowered(&settings) {
            (settings, steps) = (lowered, steps + 1);
        }
        let share = settings.winding.emf.to_volts() / emf;
        assert!(steps == 15 && (share - 0.85).abs() < 1e-4, "{steps} steps to {share}");
        assert!((drag(&settings) - before).abs() < 1e-2, "{} 1/s, before {before}", drag(&settings));
    }
}
