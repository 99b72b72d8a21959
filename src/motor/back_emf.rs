//! Corrects the configured constants of a motor that has become warm, or whose speed hunts.
//!
//! Per kelvin, the resistance of copper grows by 0.39 %, and the field of the magnets falls by some 0.2 %. Two things
//! correct the constants in force:
//!
//! * The [thermal model](super::thermal) computes the temperatures of a motor with a thermal limit. Back EMF constant,
//!   dynamics and duty rule follow these temperatures.
//! * While the speed [hunts](crate::regulator::Output::hunts), the back EMF constant in force is lowered in steps, down
//!   to the largest correction. This correction ends when another back EMF or other dynamics are configured.
//!
//! The back EMF constant in force is the lower of the two corrected constants. The configured resistance and back EMF
//! belong to a cold motor, as data sheets state them. The configured dynamics belong to the temperatures at which they
//! were configured: a user identifies a motor, warm or cold, and then configures the result. Stored dynamics that the
//! hub restores at its start belong to a cold motor. Currents for reports and limits are still computed with the cold
//! resistance. The motor may be colder than the model says, and the cold resistance gives the higher current.

use super::thermal::Temperatures;
use crate::braking::{Modulator, Winding};
use crate::settings::{Dynamics, Settings};
use crate::units::{AccelerationPerVolt, DecayRate, EmfConstant, Millivolts, Resistance};

/// Step of a correction by hunting, in % of the configured constant.
const STEP_PERCENT: u8 = 1;
/// Largest correction by hunting, in % of the configured constant. The magnets of a motor lose 15 % of their field when
/// they warm up by 75 K.
const LARGEST_PERCENT: u8 = 15;
/// Least change of the winding's temperature, in K, after which the constants in force are corrected again. This change
/// alters the resistance by some 1 %.
const STEP_K: u8 = 3;
/// Least change of the magnets' temperature, in K, after which the constants in force are corrected again. This change
/// alters the field by 1 %. The winding of a derated motor keeps its temperature while the magnets still warm up.
const MAGNETS_STEP_K: u8 = 5;

/// The configured constants of a motor, and what has changed since they were configured. The motor's settings have the
/// constants in force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Configured {
    emf: EmfConstant,
    dynamics: Option<Dynamics>,
    /// Temperatures for which the dynamics are configured.
    dynamics_at: Temperatures,
    /// Temperatures of the constants in force.
    temperatures: Temperatures,
    /// Correction of the back EMF constant by hunting, in % of the configured constant.
    lowered_percent: u8,
}

impl Configured {
    /// Takes the configured constants of a cold motor from settings as configured, without corrections.
    pub(super) const fn new(settings: &Settings) -> Self {
        Self {
            emf: settings.winding.emf,
            dynamics: settings.dynamics,
            dynamics_at: Temperatures::COLD,
            temperatures: Temperatures::COLD,
            lowered_percent: 0,
        }
    }

    /// Takes the constants of new settings as configured, without corrections. A correction by hunting stays if the
    /// back EMF and the dynamics are the same as before.
    pub(super) fn configure(&mut self, settings: &Settings) {
        if self.emf != settings.winding.emf || self.dynamics != settings.dynamics {
            let temperatures = self.temperatures;
            // Dynamics that stay belong to the temperatures at which they were configured.
            let dynamics_at =
                if self.dynamics == settings.dynamics { self.dynamics_at } else { temperatures };
            *self = Self { dynamics_at, temperatures, ..Self::new(settings) };
        }
    }

    /// Lowers the back EMF constant in force by a step. Returns false if the correction has reached its limit.
    pub(super) fn lower_emf_constant(&mut self) -> bool {
        let lowered = 100.0 * (1.0 - self.emf_share());
        // The constant of a warm motor is already lower. The step starts from this lower constant.
        let percent = (lowered as u8).max(self.lowered_percent) + STEP_PERCENT;
        let allowed = percent <= LARGEST_PERCENT;
        if allowed {
            self.lowered_percent = percent;
        }
        allowed
    }

    /// Takes the temperatures of the motor. Returns true if the constants in force have to follow them.
    pub(super) fn set_temperatures(&mut self, temperatures: Temperatures) -> bool {
        let changes = temperatures.winding_k.abs_diff(self.temperatures.winding_k) >= STEP_K
            || temperatures.magnets_k.abs_diff(self.temperatures.magnets_k) >= MAGNETS_STEP_K;
        if changes {
            self.temperatures = temperatures;
        }
        changes
    }

    /// Back EMF constant in force, as a share of the configured constant.
    pub(super) fn emf_share(&self) -> f32 {
        let lowered = 1.0 - f32::from(self.lowered_percent) / 100.0;
        lowered.min(self.temperatures.field_share())
    }

    /// These settings with the constants in force.
    pub(super) fn in_force(&self, settings: &Settings) -> Settings {
        let mut corrected = *settings;
        let less = self.emf.to_bits() as f32 * (1.0 - self.emf_share());
        corrected.winding.emf = EmfConstant::from_bits(self.emf.to_bits() - less as i32).unwrap_or(self.emf);
        let changed = self.temperatures != self.dynamics_at || self.lowered_percent > 0;
        corrected.dynamics = self.dynamics;
        if let Some(dynamics) = corrected.dynamics.as_mut().filter(|_| changed) {
            self.correct_dynamics(dynamics, &corrected.winding, settings.bridge.switch_mohm());
        }
        corrected
    }

    /// The modulator of a motor with these settings in force. Its duty rule is for the warm winding.
    pub(super) fn modulator(&self, in_force: &Settings) -> Modulator {
        let mut warm = *in_force;
        let milliohms = warm_milliohms(&in_force.winding, &self.temperatures);
        warm.winding.resistance =
            Resistance::from_milliohms(milliohms as u16).unwrap_or(in_force.winding.resistance);
        warm.modulator()
    }

    /// Converts the configured dynamics to the present temperatures and to the back EMF constant in force. The torque
    /// of drag and friction stays. `winding` has the cold resistance and the back EMF constant in force. `switch_mohm`
    /// is the resistance of one of the two switches of the bridge, in milliohms.
    fn correct_dynamics(&self, dynamics: &mut Dynamics, winding: &Winding, switch_mohm: u16) {
        let Self { dynamics_at: then, temperatures: now, .. } = self;
        let milliohms = |at| warm_milliohms(winding, at) + 2.0 * f32::from(switch_mohm);
        let resistance = milliohms(now) / milliohms(then);
        let volts_per_torque = resistance * then.field_share() / now.field_share();
        let old_gain = dynamics.gain.to_f32();
        let gain = old_gain / volts_per_torque;
        let drag = dynamics.decay.to_f32() - old_gain * self.emf.to_volts() * then.field_share();
        let decay = drag + gain * winding.emf.to_volts();
        let friction = f32::from(dynamics.friction.get()) * volts_per_torque;
        dynamics.gain = AccelerationPerVolt::from_bits((256.0 * gain) as u32).unwrap_or(dynamics.gain);
        dynamics.decay = DecayRate::from_bits((65_536.0 * decay) as u32);
        dynamics.friction = Millivolts::new(friction as u16);
    }
}

/// Resistance of a winding at these temperatures, in milliohms.
fn warm_milliohms(winding: &Winding, at: &Temperatures) -> f32 {
    f32::from(winding.resistance.as_milliohms()) * at.resistance_share()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A motor with dynamics.
    fn settings() -> Settings {
        let mut settings = Settings::new(Winding::NEVEREST_60);
        settings.dynamics = Some(Dynamics {
            gain: AccelerationPerVolt::from_f64(2_000.0).unwrap_or_else(|error| unreachable!("{error}")),
            decay: DecayRate::from_f64(9.0).unwrap_or_else(|error| unreachable!("{error}")),
            friction: Millivolts::new(500),
        });
        settings
    }

    /// Decay by drag, in 1/s.
    fn drag(settings: &Settings) -> f32 {
        settings.dynamics.map_or(f32::NAN, |dynamics| {
            dynamics.decay.to_f32() - dynamics.gain.to_f32() * settings.winding.emf.to_volts()
        })
    }

    #[test]
    fn the_back_emf_is_lowered_by_at_most_15_percent_and_the_drag_stays() {
        let settings = settings();
        let mut configured = Configured::new(&settings);
        assert_eq!(configured.in_force(&settings), settings);
        let mut steps = 0;
        while configured.lower_emf_constant() {
            steps += 1;
        }
        let lowered = configured.in_force(&settings);
        let share = lowered.winding.emf.to_volts() / settings.winding.emf.to_volts();
        assert!(steps == 15 && (share - 0.85).abs() < 1e-4, "{steps} steps to {share}");
        let [before, after] = [&settings, &lowered].map(drag);
        assert!((before - after).abs() < 1e-2, "{after} 1/s, before {before}");
    }

    #[test]
    fn the_constants_follow_magnets_that_warm_up_while_the_winding_keeps_its_temperature() {
        let mut configured = Configured::new(&settings());
        assert!(configured.set_temperatures(Temperatures { winding_k: 98, magnets_k: 26 }));
        assert!(!configured.set_temperatures(Temperatures { winding_k: 98, magnets_k: 30 }));
        assert!(configured.set_temperatures(Temperatures { winding_k: 98, magnets_k: 31 }));
        assert!((configured.emf_share() - 0.938).abs() < 1e-3, "{}", configured.emf_share());
    }

    #[test]
    fn a_hot_motor_has_more_resistance_less_field_and_the_same_drag() {
        let settings = settings();
        let mut configured = Configured::new(&settings);
        assert!(!configured.set_temperatures(Temperatures { winding_k: 2, magnets_k: 2 }));
        assert!(configured.set_temperatures(Temperatures { winding_k: 62, magnets_k: 50 }));
        let hot = configured.in_force(&settings);
        let share = |of: fn(&Settings) -> f32| of(&hot) / of(&settings);
        let gain =
            |settings: &Settings| settings.dynamics.map_or(f32::NAN, |dynamics| dynamics.gain.to_f32());
        assert!((share(|settings| settings.winding.emf.to_volts()) - 0.9).abs() < 1e-3);
        assert_eq!(hot.winding.resistance, settings.winding.resistance);
        let switches = 2.0 * f32::from(settings.bridge.switch_mohm()) / 1e3;
        assert!((share(gain) * (3.3 * 1.2418 + switches) / (3.3 + switches) - 0.9).abs() < 1e-3);
        assert!((drag(&hot) - drag(&settings)).abs() < 1e-2);
        let friction = hot.dynamics.map(|dynamics| dynamics.friction.get());
        assert!(friction.is_some_and(|mv| (500.0 / share(gain) - f32::from(mv)).abs() < 2.0), "{friction:?}");

        // With another back EMF the same dynamics still belong to the cold motor.
        let mut other = settings;
        other.winding.emf =
            EmfConstant::from_bits(settings.winding.emf.to_bits() + 1_000).unwrap_or(other.winding.emf);
        let mut of_other = configured;
        of_other.configure(&other);
        assert!(other.winding != settings.winding && of_other.in_force(&other).dynamics != settings.dynamics);

        // Dynamics that are configured now belong to the hot motor.
        let identified = Settings { dynamics: hot.dynamics, ..settings };
        configured.configure(&identified);
        let in_force = configured.in_force(&identified);
        assert_eq!(in_force.dynamics, hot.dynamics);
        assert_eq!(in_force.winding, hot.winding);
        // The constant of a hot motor that also hunts is lower still.
        assert!(
            configured.lower_emf_constant() && (configured.emf_share() - 0.89).abs() < 1e-3,
            "{}",
            configured.emf_share()
        );
    }
}
