//! Dynamics of a motor with its load, in the encoder's units.

use crate::braking::Winding;
use crate::bridge::BridgeConstants;
use crate::units::{AccelerationPerVolt, DecayRate, Millivolts, RangeError};

/// Constants of a motor with its load, besides the back EMF. The motor's equation is
///
/// ```text
/// acceleration = b u - q w - b c sign(w) + load
/// ```
///
/// where u is the voltage of the mean current (back EMF plus current times resistance), w the speed, and c the
/// friction. The load is the acceleration by an external torque, which the regulator estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Dynamics {
    /// Acceleration per volt, b.
    pub gain: AccelerationPerVolt,
    /// Decay of the speed by back EMF and drag, q.
    pub decay: DecayRate,
    /// Voltage that balances the friction of the moving motor, c; 0 if unknown.
    pub friction: Millivolts,
}

/// Constants of a motor and its load as data sheets state them, all referred to the motor's shaft.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mechanics {
    /// Torque per current, Kt, in N m/A.
    pub torque_constant: f64,
    /// Encoder counts per turn of the motor.
    pub counts_per_turn: f64,
    /// Moment of inertia of rotor and load, J, in kg m².
    pub inertia: f64,
    /// Viscous drag of rotor and load, B, in N m s/rad.
    pub drag: f64,
    /// Coulomb friction, in N m.
    pub friction: f64,
}

impl Dynamics {
    /// Computes the dynamics from physical constants. R is the resistance of winding and bridge, Ke the back EMF per
    /// speed, and kc the number of counts per radian: `b = Kt kc / (R J)`, `q = b Ke / kc + B / J`, `c = R friction /
    /// Kt`.
    ///
    /// # Errors
    /// Fails if b, q or c is out of its type's range or not a number.
    pub const fn from_mechanics(
        winding: &Winding,
        bridge: &BridgeConstants,
        mechanics: &Mechanics,
    ) -> Result<Self, RangeError> {
        let Mechanics { torque_constant, counts_per_turn, inertia, drag, friction } = *mechanics;
        let milliohms = winding.resistance.as_milliohms() as f64 + 2.0 * bridge.switch_mohm() as f64;
        let ohms = milliohms / 1e3;
        let b = torque_constant * counts_per_turn / (core::f64::consts::TAU * ohms * inertia);
        let gain = match AccelerationPerVolt::from_f64(b) {
            Ok(gain) => gain,
            Err(error) => return Err(error),
        };
        let volts_per_speed = winding.emf.to_millivolt_seconds() / 1e3;
        let decay = match DecayRate::from_f64(b * volts_per_speed + drag / inertia) {
            Ok(decay) => decay,
            Err(error) => return Err(error),
        };
        match Millivolts::from_volts(ohms * friction / torque_constant) {
            Ok(friction) => Ok(Self { gain, decay, friction }),
            Err(error) => Err(error),
        }
    }
}
