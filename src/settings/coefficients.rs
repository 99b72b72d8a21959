//! PID coefficients that a host configures.

use super::dynamics::GUESSED_TIME_CONSTANT_S;
use crate::braking::{Blend, BlendFraction, Scheme};
use crate::motion::Pidf;
use crate::units::{Coefficient, Control, EmfConstant, Period};
use libm::{expf, expm1f, logf, roundf};

/// Bandwidth of the closed velocity loop with suggested coefficients, in 1/s.
const BANDWIDTH: f32 = 18.0;
/// Least share of a speed's error that remains after a tick with suggested coefficients.
const QUICKEST_POLE: f32 = 0.6;
/// Least P of suggested coefficients, in multiples of f (see [`Coefficients::guessed`]).
const LEAST_P: f32 = 0.3;
/// Battery voltage for which coefficients are suggested, in V.
const NOMINAL_VOLTS: f32 = 12.0;
/// Cycles of 50 ms in a second. Hosts state I per cycle.
const CYCLES_PER_SECOND: f32 = 20.0;
/// Ratio of the bandwidth of the velocity loop to the bandwidth of the suggested position loop. The ratio is large,
/// because the motor may be much heavier than a bare gear motor.
const POSITION_SLOWER: f32 = 6.0;

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
    /// Suggests coefficients for an unknown motor, as for a bare gear motor on a battery of 12 V. In REV's protocol
    /// hosts read the coefficients of any motor, and change single coefficients. For a motor without coefficients the
    /// hub answers with the suggested coefficients.
    ///
    /// T is the control period in s. From one tick to the next a bare gear motor keeps `a = exp(-T / 0.14 s)` of its
    /// speed. Both poles are placed at z, which is the larger of `exp(-18 T)` and 0.6. The factor `f` is in control
    /// steps per count/s, and gives full control at the speed whose back EMF is 12 V. P is at least 0.3 f:
    ///
    /// ```text
    /// P = f (a - z^2) / (1 - a)    I = f (1 - z)^2 / ((1 - a) T)
    /// ```
    ///
    /// In Schemes B, C and D a control value is a current. The back EMF then does not damp the motor, and P grows by
    /// f to compensate. In Schemes C and D the control range has less current, so P and I grow by 60 %. With a fixed
    /// blend of Scheme D, P and I lie between the values for B and C.
    ///
    /// The position loop has only P, which is `-ln(z) / T` divided by 6, in 1/s.
    pub fn guessed(emf: EmfConstant, scheme: Scheme, period: Period) -> Self {
        let f = emf.to_volts() * f32::from(Control::MAX.get()) / NOMINAL_VOLTS;
        let seconds = period.to_seconds();
        let lost = -expm1f(-seconds / GUESSED_TIME_CONSTANT_S);
        let kept = 1.0 - lost;
        let pole = expf(-BANDWIDTH * seconds).max(QUICKEST_POLE);
        let bandwidth = -logf(pole) / seconds;
        let p = ((kept - pole * pole) / lost).max(LEAST_P);
        let i = (1.0 - pole) * (1.0 - pole) / (lost * seconds);
        // `share` is 0 for Scheme B, 1 for Scheme C, and between 0 and 1 for a blend of both.
        let narrow = |share: f32| {
            let more = 1.0 + 0.6 * share;
            ((p + 1.0) * more, i * more)
        };
        let (p, i) = match scheme {
            Scheme::ForwardReverse | Scheme::A => (p, i),
            Scheme::B => narrow(0.0),
            Scheme::C | Scheme::D(Blend::Automatic) => narrow(1.0),
            Scheme::D(Blend::Fixed(blend)) => {
                narrow(blend.to_bits() as f32 / BlendFraction::ONE.to_bits() as f32)
            }
        };
        let pi = |p: f32, i: f32| Pidf {
            p: coefficient(p),
            i: coefficient(i / CYCLES_PER_SECOND),
            ..Pidf::default()
        };
        Self { velocity: pi(p * f, i * f), position: pi(bandwidth / POSITION_SLOWER, 0.0) }
    }
}

/// Rounds to the nearest step of 2^-16; saturates at the ends of the range.
fn coefficient(value: f32) -> Coefficient {
    Coefficient::from_bits(roundf(65_536.0 * value) as i32)
}
