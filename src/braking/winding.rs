//! Electrical constants of a motor.

use crate::units::{EmfConstant, Inductance, Resistance, constant};

/// Electrical constants of a motor's winding. The back EMF is per encoder speed.
///
/// The duties of [linear current](mod@super::linear_current) depend little on resistance and inductance: an error of a
/// factor of two is tolerable. If the inductance is unknown, the formulas treat the current as continuous, as at a high
/// PWM frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Winding {
    /// Back EMF per encoder speed.
    pub emf: EmfConstant,
    /// Resistance at the terminals.
    pub resistance: Resistance,
    /// Inductance; `None` if unknown.
    pub inductance: Option<Inductance>,
}

impl Winding {
    /// An AndyMark NeveRest 60: 3.3 ohm, 694 uH, 533/30000 V s/rad and 28 counts per revolution of the motor, which is
    /// 3.98683 mV s/count. These constants are a fair guess for any 12 V gear motor of a robot.
    pub const NEVEREST_60: Self = Self {
        emf: constant!(EmfConstant::from_ke(533.0 / 30_000.0, 28.0)),
        resistance: constant!(Resistance::from_ohms(3.3)),
        inductance: Some(constant!(Inductance::from_millihenries(0.694))),
    };
}
