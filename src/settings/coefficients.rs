//! Coefficients of a host for PID regulation.

use super::dynamics::GUESSED_TIME_CONSTANT_S;
use crate::braking::{Blend, BlendFraction, Scheme};
use crate::motion::Pidf;
use crate::units::{Coefficient, Control, EmfConstant, Period};
use libm::{expf, expm1f, logf, roundf};

/// Bandwidth of the closed velocity loop by suggested coefficients, in 1/s.
const BANDWIDTH: f32 = 18.0;
/// Least share of a speed's error that suggested coefficients leave after a tick.
const QUICKEST_POLE: f32 = 0.6;
/// Least P of suggested coefficients, in full control at the speed whose back EMF is 12 V.
const LEAST_P: f32 = 0.3;
/// Battery voltage for which coefficients are suggested, in V.
const NOMINAL_VOLTS: f32 = 12.0;
/// Cycles of 50 ms in a second. Hosts state I per cycle.
const CYCLES_PER_SECOND: f32 = 20.0;
/// Ratio of the bandwidths of velocity loop and suggested position loop. The motor may be much heavier than a bare gear
/// motor.
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
    /// Suggests coefficients for an unknown motor, which counts as a bare gear motor on a battery of 12 V. REV's protocol
    /// lets hosts read coefficients from any motor, and change single ones. A motor without coefficients answers with these.
    ///
    /// From one tick to the next a bare gear motor keeps `a = exp(-T / 0.14 s)` of its speed. Both poles are placed at
    /// `z = exp(-18 T)`, or 0.6. With `f` control steps per count/s, which is full control at the speed
    /// whose back EMF is 12 V:
    ///
    /// ```text
    /// P = f (a - z^2) / (1 - a)    I = f (1 - z)^2 / ((1 - a) T)
    /// ```
    ///
    /// Where a control value is a current, the back EMF does not damp the motor, and P grows by f to compensate. In
    /// Schemes C and D the control range spans less current, so P and I grow by up to 60 %. A fixed blend lies
    /// between B and C.
    pub fn guessed(emf: EmfConstant, scheme: Scheme, period: Period) -> Self {
        let f = emf.to_volts() * f32::from(Control::MAX.get()) / NOMINAL_VOLTS;
        let seconds = period.to_seconds();
        let lost = -expm1f(-seconds / GUESSED_TIME_CONSTANT_S);
        let kept = 1.0 - lost;
        let pole = expf(-BANDWIDTH * seconds).max(QUICKEST_POLE);
        let bandwidth = -logf(pole) / seconds;
        let p = ((kept - pole * pole) / lost).max(LEAST_P);
        let i = (1.0 - pole) * (1.0 - pole) / (lost * seconds);
        // `share` is how far the scheme is from B to C.
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
