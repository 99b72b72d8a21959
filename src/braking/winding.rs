//! What the hub must know of a motor.

use crate::units::{EmfConstant, Inductance, Resistance, constant};

/// A motor's winding, with the encoder that its speed is counted by.
///
/// A resistance that is wrong by a factor of two costs little. So does an inductance; of one that is
/// unknown the current is taken for continuous, the limit of a high PWM frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Winding {
    /// Back EMF per encoder speed.
    pub emf: EmfConstant,
    /// At the terminals.
    pub resistance: Resistance,
    /// `None` if nobody has measured it.
    pub inductance: Option<Inductance>,
}

impl Winding {
    /// An AndyMark NeveRest 60: 3.3 ohm, 694 uH, 533/30000 V s/rad and 28 counts a revolution of the motor,
    /// which are 3.98683 mV s/count. As good a guess as any for a 12 V gear motor of a robot.
    pub const NEVEREST_60: Self = Self {
        emf: constant!(EmfConstant::from_ke(533.0 / 30_000.0, 28.0)),
        resistance: constant!(Resistance::from_ohms(3.3)),
        inductance: Some(constant!(Inductance::from_millihenries(0.694))),
    };
}
