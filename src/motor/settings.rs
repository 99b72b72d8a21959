//! What a motor is told of itself once: its winding, its scheme, its load.

use super::{Report, ThermalLimit};
use crate::braking::{DutyRule, Modulator, Scheme, Winding};
use crate::bridge::BridgeConstants;
use crate::regulator::{Coefficients, Config, Dynamics};
use crate::units::{Acceleration, Milliamperes, Millivolts};
use core::num::NonZeroU16;

/// What a zero set-point means in constant power and in regulated velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ZeroPower {
    /// Constant power: full dynamic braking. Regulated velocity: held at standstill.
    #[default]
    Brake,
    /// The bridge is open.
    Float,
}

/// What becomes of a motor that a fault keeps from doing what it is asked, or whose host has fallen silent.
///
/// Braking shorts the winding (5/0 at 100 %), for which nobody needs to know its speed. It is out of the question
/// where the bridge or the battery is the fault: then every motor coasts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum OnFault {
    /// The bridge is open: nothing of it gets hot, and a load may run away.
    #[default]
    Coast,
    /// Full dynamic braking: a load sinks slowly instead of falling, and never stands still by that.
    Brake,
}

/// What does not change from tick to tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// What is connected.
    pub winding: Winding,
    /// By what it is driven.
    pub bridge: BridgeConstants,
    /// Where S, T, Z and G lie.
    pub scheme: Scheme,
    /// How the duty is found within a regime.
    pub duty: DutyRule,
    /// What zero means.
    pub zero_power: ZeroPower,
    /// What a fault does to it.
    pub on_fault: OnFault,
    /// What its winding stands; `None` for a motor that nothing protects from its own current.
    pub thermal: Option<ThermalLimit>,
    /// Largest current in mA, in either direction, driving or braking. `None` for a motor that may draw its stall current.
    pub current_limit: Option<NonZeroU16>,
    /// Dynamics of the motor with its load; `None` for an unknown motor, whose acceleration per volt the regulator learns.
    pub dynamics: Option<Dynamics>,
    /// Coefficients that a host has set, with which PID regulates the motor; `None` if the model regulates it.
    pub coefficients: Option<Coefficients>,
    /// Largest acceleration under the model regulator; `None` for the limit that the battery sets.
    pub acceleration: Option<Acceleration>,
    /// A motor that does not turn though it should may be driven the other way, once, to find out whether its
    /// encoder is at fault. Otherwise it is taken to be, unless something moves the motor.
    pub probing: bool,
}

impl Settings {
    /// [`for_scheme`](Self::for_scheme) A, the default.
    pub const fn new(winding: Winding) -> Self {
        Self::for_scheme(winding, Scheme::A)
    }

    /// Settings that run a gear motor with this winding on an ideal bridge: linear current, and brake at zero. Motor and load
    /// are not configured, so the regulator learns the acceleration per volt.
    pub const fn for_scheme(winding: Winding, scheme: Scheme) -> Self {
        Self {
            winding,
            bridge: BridgeConstants::IDEAL,
            scheme,
            duty: DutyRule::LinearCurrent,
            zero_power: ZeroPower::Brake,
            on_fault: OnFault::Coast,
            thermal: None,
            current_limit: None,
            dynamics: None,
            coefficients: None,
            acceleration: None,
            probing: true,
        }
    }

    /// What the regulator is told of them.
    pub(super) const fn regulation(&self) -> Config {
        let Self { winding, dynamics, coefficients, acceleration, .. } = *self;
        Config { emf: winding.emf, dynamics, coefficients, acceleration }
    }

    /// Of winding and bridge together, in ohms.
    pub(super) fn ohms(&self) -> f32 {
        let milliohms =
            u32::from(self.winding.resistance.as_milliohms()) + 2 * u32::from(self.bridge.switch_mohm());
        milliohms as f32 / 1000.0
    }

    /// What the bridge takes from the bus by these constants, mean; negative for what it returns. It keeps no energy, so
    /// that is the current's share of the battery's voltage that stands across the motor: the duty while it drives.
    pub fn drawn(&self, report: &Report, battery: Millivolts) -> Milliamperes {
        let amperes = 1e-3 * report.best_current().get() as f32;
        let across = self.winding.emf.emf(report.velocity).to_volts() + amperes * self.ohms();
        // Nothing is known of the battery, and nothing flows.
        let share = if battery.get() == 0 { 0.0 } else { across / battery.to_volts() };
        Milliamperes::from_amperes(amperes * share)
    }

    /// Maps voltages and control values of the motor to commands of its bridge.
    pub(super) fn modulator(&self) -> Modulator {
        Modulator::new(&self.winding, &self.bridge, self.scheme, self.duty)
    }
}
