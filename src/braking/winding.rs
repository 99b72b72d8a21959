//! What the hub must know of a motor.

use crate::units::{EmfConstant, RangeError};

/// A motor's winding, with the encoder that its speed is counted by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Winding {
    emf: EmfConstant,
    resistance_mohm: u16,
    inductance_uh: Option<u16>,
}

impl Winding {
    /// An AndyMark NeveRest 60: 3.3 ohm, 694 uH, 533/30000 V s/rad and 28 counts a revolution of the motor,
    /// which are 3.98683 mV s/count. As good a guess as any for a 12 V gear motor of a robot.
    pub const NEVEREST_60: Self = match EmfConstant::from_bits(4_180_495) {
        Ok(emf) => Self { emf, resistance_mohm: 3300, inductance_uh: Some(694) },
        Err(_) => panic!("in range"),
    };

    /// Back EMF per encoder speed; resistance in milliohms, from 1; inductance in microhenries.
    ///
    /// A resistance that is wrong by a factor of two costs little. So does an inductance; of one that is
    /// unknown, `None` or 0, the current is taken for continuous, the limit of a high PWM frequency.
    ///
    /// # Errors
    /// [`RangeError::Electrical`] if the resistance is 0.
    pub const fn new(
        emf: EmfConstant,
        resistance_mohm: u16,
        inductance_uh: Option<u16>,
    ) -> Result<Self, RangeError> {
        if resistance_mohm == 0 {
            return Err(RangeError::Electrical);
        }
        let inductance_uh = match inductance_uh {
            Some(0) => None,
            other => other,
        };
        Ok(Self { emf, resistance_mohm, inductance_uh })
    }

    /// The same with another back EMF per encoder speed.
    #[must_use]
    pub const fn with_emf(self, emf: EmfConstant) -> Self {
        Self { emf, ..self }
    }

    /// Back EMF per encoder speed.
    pub const fn emf(&self) -> EmfConstant {
        self.emf
    }

    /// Resistance in milliohms, 1 to 65 535.
    pub const fn resistance_mohm(&self) -> u16 {
        self.resistance_mohm
    }

    /// Inductance in microhenries, 1 to 65 535; `None` if unknown.
    pub const fn inductance_uh(&self) -> Option<u16> {
        self.inductance_uh
    }
}
