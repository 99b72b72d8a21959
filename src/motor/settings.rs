//! What a motor is told of itself once: its winding, its scheme, its loops.

use crate::braking::{DutyRule, Placer, Scheme, Winding};
use crate::bridge::BridgeConstants;
use crate::motion::Pidf;
use crate::units::{Coefficient, Control};

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
    /// Coefficients of regulated velocity.
    pub velocity: Pidf,
    /// Coefficients of the position loop above it.
    pub position: Pidf,
}

impl Settings {
    /// [`for_scheme`](Self::for_scheme) A, the default.
    pub const fn new(winding: Winding) -> Self {
        Self::for_scheme(winding, Scheme::A)
    }

    /// Settings that run a gear motor with this winding on a bridge of the VNH5019 kind: linear current,
    /// brake at zero, and coefficients in proportion to the motor's speed range.
    ///
    /// With `f` control steps per count/s, which is full control at the speed whose back EMF is 12 V:
    /// in Scheme A, where a control value is a voltage, P is 1.5 f. Where it is a current, the back EMF
    /// does not damp the motor, and P makes up for it by another f; in C and D, whose range is less current,
    /// it is 4 f, the best of those that `motor-hub compare` tries. I is 7.5 f per second, P's gain in A in
    /// 0.2 s, about the mechanical time constant of a loaded gear motor. Nothing is fed forward: what
    /// a set-point needs depends on the load, and the integral has it soon.
    pub const fn for_scheme(winding: Winding, scheme: Scheme) -> Self {
        // From 6q20 to Q16.16; f is at most 87.4.
        let f = (winding.emf.to_bits() as i64 * Control::MAX.get() as i64 / (12_000 << 4)) as i32;
        let p = match scheme {
            Scheme::ForwardReverse | Scheme::A => 3 * f / 2,
            Scheme::B => 5 * f / 2,
            Scheme::C | Scheme::D(_) => 4 * f,
        };
        Self {
            winding,
            bridge: BridgeConstants::VNH5019,
            scheme,
            duty: DutyRule::LinearCurrent,
            zero_power: ZeroPower::Brake,
            velocity: Pidf {
                p: Coefficient::from_bits(p),
                i: Coefficient::from_bits(15 * f / 2),
                d: Coefficient::ZERO,
                f: Coefficient::ZERO,
            },
            position: Pidf {
                p: Coefficient::from_bits(5 << 16),
                i: Coefficient::ZERO,
                d: Coefficient::ZERO,
                f: Coefficient::ZERO,
            },
        }
    }

    /// What turns control values into drives by them.
    pub(super) fn placer(&self) -> Placer {
        Placer::new(&self.winding, &self.bridge, self.scheme, self.duty)
    }
}
