//! PID coefficients that a host configures.

use crate::motion::Pidf;
use crate::units::{Coefficient, Control, EmfConstant};
use libm::roundf;

/// Battery voltage for which F is suggested, in V.
const NOMINAL_VOLTS: f32 = 12.0;
/// Suggested P of the velocity loop, as a share of F.
const P_SHARE: f32 = 0.25;
/// Suggested I of the velocity loop per cycle of 50 ms, as a share of F.
const I_SHARE: f32 = 0.1;
/// Suggested P of the position loop, in counts/s per count. An error of the position then decays with a time constant
/// of 0.5 s, which is slower than the velocity loop of a motor without load.
const POSITION_P: f32 = 2.0;

/// Coefficients of both loops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Coefficients {
    /// Coefficients of the velocity loop.
    pub velocity: Pidf,
    /// Coefficients of the position loop above the velocity loop.
    pub position: Pidf,
}

impl Coefficients {
    /// Suggests coefficients for a motor without configured coefficients. In REV's protocol hosts read the coefficients
    /// of any motor, and change single coefficients. A host that reads the coefficients of a motor without any gets the
    /// suggested coefficients.
    ///
    /// F of the velocity loop gives the voltage that balances the back EMF of the target speed, on a battery of 12 V.
    /// Of all pairs of P and I that were tried, only P of 25 % and I of 10 % of F passed all 144 cells of a test
    /// with four motors each (decision 34). The position loop has only P.
    pub fn suggested(emf: EmfConstant) -> Self {
        let f = emf.to_volts() * f32::from(Control::MAX.get()) / NOMINAL_VOLTS;
        let [p, i, f] = [P_SHARE * f, I_SHARE * f, f].map(coefficient);
        Self {
            velocity: Pidf { p, i, d: Coefficient::ZERO, f },
            position: Pidf { p: coefficient(POSITION_P), ..Pidf::default() },
        }
    }
}

/// Rounds to the nearest step of 2^-16; saturates at the ends of the range.
fn coefficient(value: f32) -> Coefficient {
    Coefficient::from_bits(roundf(65_536.0 * value) as i32)
}
