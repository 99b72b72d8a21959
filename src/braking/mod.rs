//! From a control value to what the bridge does: proportional braking.
//!
//! At each tick the four points S, T, Z, G are computed from speed and battery voltage
//! ([`points`]) as the motor's [`scheme`] says; where the control value lies among them decides
//! regime, mode and duty. The duty is either linear within its regime, as in the paper ([`place`]),
//! or such that the motor's mean current is linear ([`place_current`]).

mod explog;
pub mod linear_current;
pub mod points;
pub mod scheme;

pub use linear_current::{Electrical, LinearCurrent};
pub use points::{Abscissa, Fraction, OperatingPoint, Place, Points, Regime};
pub use scheme::{Blend, BlendFraction, Scheme};

use crate::bridge::Drive;
use crate::units::{Control, Duty};

/// A control value turned into a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    /// Relative to the motion.
    pub regime: Regime,
    /// What the bridge is told.
    pub drive: Drive,
}

impl Placement {
    const fn new(regime: Regime, duty: Duty, at: OperatingPoint) -> Self {
        Self { regime, drive: Drive { mode: regime.mode(at.counter_clockwise()), duty } }
    }
}

/// How the duty is found within a regime.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DutyRule {
    /// Linear between the points, as in the paper.
    LinearDuty,
    /// Such that the mean current is linear between the points.
    LinearCurrent(LinearCurrent),
}

impl DutyRule {
    /// Regime, mode and duty of a control value at an operating point.
    pub const fn place(&self, scheme: Scheme, at: OperatingPoint, control: Control) -> Placement {
        match self {
            Self::LinearDuty => place(scheme, at, control),
            Self::LinearCurrent(winding) => place_current(winding, scheme, at, control),
        }
    }
}

/// The control value as a motor that turns CW would be given it.
const fn clockwise(at: OperatingPoint, control: Control) -> Control {
    if at.counter_clockwise() { control.reversed() } else { control }
}

/// S of the bridge itself: driven against the motion with all it has, whatever the scheme.
pub const fn full_reverse(at: OperatingPoint) -> Placement {
    Placement::new(Regime::Reverse, Duty::ONE, at)
}

/// Regime, mode and duty of a control value at an operating point; the duty is linear between the
/// points (paper, section 1.3).
pub const fn place(scheme: Scheme, at: OperatingPoint, control: Control) -> Placement {
    let Place { regime, fraction } = Points::new(scheme, at).place(clockwise(at, control));
    Placement::new(regime, fraction.to_duty(), at)
}

/// Regime, mode and duty of a control value at an operating point; the motor's mean current is linear
/// between the points.
pub const fn place_current(
    winding: &LinearCurrent,
    scheme: Scheme,
    at: OperatingPoint,
    control: Control,
) -> Placement {
    let place = Points::new(scheme, at).place(clockwise(at, control));
    // A battery that cannot push asks for no current.
    let place = match place.regime {
        Regime::Forward if at.is_overrun() => Place { regime: Regime::Braking, fraction: Fraction::ZERO },
        _ => place,
    };
    Placement::new(place.regime, winding.duty(place, at), at)
}
