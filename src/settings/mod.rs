//! Settings of a motor: its winding, bridge, scheme, protection and regulation.
//!
//! A motor stores its settings once, and passes them to its parts.
//!
//! ```
//! use motor_hub::braking::Winding;
//! use motor_hub::bridge::BridgeConstants;
//! use motor_hub::settings::{Dynamics, Mechanics};
//!
//! // A bare NeveRest 60: rotor alone, in SI units.
//! let rotor = Mechanics {
//!     torque_constant: 0.0178,
//!     counts_per_turn: 28.0,
//!     inertia: 1.0e-5,
//!     drag: 1.4e-6,
//!     friction: 0.0,
//! };
//! let dynamics =
//!     Dynamics::from_mechanics(&Winding::NEVEREST_60, &BridgeConstants::IDEAL, &rotor).expect("in range");
//! assert_eq!(dynamics.gain.to_f32().round(), 2_333.0); // counts/s² per volt
//! assert!((1.0 / dynamics.decay.to_f32() - 0.1).abs() < 0.01); // mechanical time constant, s
//! ```

mod coefficients;
mod dynamics;
mod thermal_limit;

pub use coefficients::Coefficients;
pub use dynamics::{Dynamics, Mechanics};
pub use thermal_limit::ThermalLimit;

use crate::braking::{DutyRule, Modulator, Scheme, Winding};
use crate::bridge::BridgeConstants;
use crate::units::Acceleration;
use core::num::NonZeroU16;

/// Meaning of the set-point 0 in constant power and in regulated velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum ZeroPower {
    /// Constant power 0 is full dynamic braking. Velocity 0 holds the motor at standstill.
    #[default]
    Brake,
    /// The bridge is open, and the motor coasts.
    Float,
}

/// Reaction of a motor to a fault, and to a host that no longer sends packets. With a fault of bridge or battery every
/// motor coasts. In constant power a fault of the encoder causes no reaction.
///
/// Braking shorts the winding (5/0 at 100 %), and so needs no estimate of the speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum OnFault {
    /// The bridge is open. The motor does not heat up, but a load may drive the motor faster and faster.
    #[default]
    Coast,
    /// The motor brakes with a shorted winding. A load sinks slowly instead of falling, but is not stopped.
    Brake,
}

/// Settings of a motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Settings {
    /// Electrical constants of the motor.
    pub winding: Winding,
    /// Constants of the motor's bridge.
    pub bridge: BridgeConstants,
    /// Scheme that defines S, T, Z and G.
    pub scheme: Scheme,
    /// Rule by which the duty follows from the location in a regime.
    pub duty: DutyRule,
    /// Meaning of the set-point 0.
    pub zero_power: ZeroPower,
    /// Reaction to a fault.
    pub on_fault: OnFault,
    /// Thermal limit of the winding; `None` for a motor without thermal protection.
    pub thermal: Option<ThermalLimit>,
    /// Largest current in mA, in either direction, driving or braking. `None` for a motor that may draw its stall
    /// current.
    pub current_limit: Option<NonZeroU16>,
    /// Dynamics of the motor with its load; `None` for an unknown motor, whose acceleration per volt the regulator
    /// estimates.
    pub dynamics: Option<Dynamics>,
    /// PID coefficients that a host has configured. `None` if the model regulator regulates the motor.
    pub coefficients: Option<Coefficients>,
    /// Largest acceleration that the model regulator requests; `None` for no limit.
    pub acceleration: Option<Acceleration>,
}

impl Settings {
    /// The default settings: [`for_scheme`](Self::for_scheme) with Scheme A.
    pub const fn new(winding: Winding) -> Self {
        Self::for_scheme(winding, Scheme::A)
    }

    /// The settings of a gear motor with this winding on an ideal bridge: linear current, and brake at the set-point
    /// 0. The dynamics are not configured, so the regulator estimates the acceleration per volt.
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
        }
    }

    /// Largest current in amperes; `None` without a limit.
    pub(crate) fn current_limit_amperes(&self) -> Option<f32> {
        self.current_limit.map(|limit| f32::from(limit.get()) / 1000.0)
    }

    /// Resistance of winding and bridge, in ohms.
    pub(crate) fn ohms(&self) -> f32 {
        let milliohms =
            u32::from(self.winding.resistance.as_milliohms()) + 2 * u32::from(self.bridge.switch_mohm());
        milliohms as f32 / 1000.0
    }

    /// Returns the modulator for these settings, which maps voltages and control values of the motor to commands of the
    /// bridge.
    pub(crate) fn modulator(&self) -> Modulator {
        Modulator::new(&self.winding, &self.bridge, self.scheme, self.duty)
    }
}
