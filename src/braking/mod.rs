//! From a control value to what the bridge does: proportional braking.
//!
//! At each tick the four points S, T, Z, G are computed from speed and battery voltage
//! ([`points`]) as the motor's [`scheme`] says; where the control value lies among them decides
//! regime, mode and duty. The duty is linear within its regime, as in the paper.

pub mod points;
pub mod scheme;

pub use points::{Abscissa, OperatingPoint, Place, Points, Regime};
pub use scheme::{Blend, BlendFraction, Scheme};

use crate::bridge::{Drive, Mode};
use crate::units::Control;

/// A control value turned into a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    /// Relative to the motion.
    pub regime: Regime,
    /// What the bridge is told.
    pub drive: Drive,
}

/// Regime, mode and duty of a control value at an operating point.
///
/// Counter-clockwise motion is the mirror image: the control value is negated before it is placed,
/// and 9/8 and 6/2 change places after.
pub const fn place(scheme: Scheme, at: OperatingPoint, control: Control) -> Placement {
    let mirrored = at.counter_clockwise();
    let clockwise_control = if mirrored { Control::new(-control.get()) } else { control };
    let Place { regime, fraction } = Points::new(scheme, at).place(clockwise_control);
    let mode = match regime {
        Regime::Forward => Mode::Cw98,
        Regime::Braking => Mode::Brake50,
        Regime::Reverse => Mode::Ccw62,
    };
    let mode = if mirrored { mode.mirrored() } else { mode };
    Placement { regime, drive: Drive { mode, duty: fraction } }
}
