//! From a control value to what the bridge does: proportional braking.
//!
//! At each tick the four points S, T, Z, G are computed from speed and battery voltage
//! ([`points`]) as the motor's [`scheme`] says; where the control value lies among them decides
//! regime, mode and duty. The duty is either linear within its regime, as in the paper ([`place`]),
//! or such that the motor's mean current is linear ([`place_current`]).
//!
//! ```
//! use motor_hub::braking::{DutyRule, OperatingPoint, Placer, Regime, Scheme, Winding};
//! use motor_hub::bridge::{BridgeConstants, Mode};
//! use motor_hub::units::{Control, CountsPerSecond, Millivolts};
//!
//! // A NeveRest 60 at half of its speed on 12 V is asked, in Scheme A, for a third of that voltage: less
//! // than its back EMF of 6 V, so it is braked in proportion.
//! let winding = Winding::NEVEREST_60;
//! let placer = Placer::new(&winding, &BridgeConstants::IDEAL, Scheme::A, DutyRule::LinearCurrent);
//! let emf = winding.emf.emf(CountsPerSecond::new(1505));
//! let at = OperatingPoint::new(emf, Millivolts::new(12_000)).expect("there is a battery");
//! let placement = placer.place(at, Control::new(10_922));
//! assert_eq!((placement.regime, placement.drive.mode), (Regime::Braking, Mode::Brake50));
//! ```

pub mod linear_current;
pub mod points;
pub mod scheme;
mod supply;
mod winding;

pub use linear_current::LinearCurrent;
pub use points::{Abscissa, Fraction, OperatingPoint, Place, Points, Regime};
pub use scheme::{Blend, BlendFraction, Scheme};
pub use supply::Returned;
pub use winding::Winding;

use crate::bridge::{BridgeConstants, Drive};
use crate::units::{Control, Duty, Voltage};
use libm::roundf;

/// A control value turned into a drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Placement {
    /// Relative to the motion.
    pub regime: Regime,
    /// What the bridge is told.
    pub drive: Drive,
    /// The voltage across the motor that stands for the current asked for.
    pub asked: Voltage,
}

impl Placement {
    /// Full dynamic braking.
    pub const fn full_braking(at: OperatingPoint) -> Self {
        Self::new(Place { regime: Regime::Braking, fraction: Fraction::ONE }, Duty::ONE, at)
    }

    /// S of the bridge itself: driven against the motion with all it has, whatever the scheme.
    pub const fn full_reverse(at: OperatingPoint) -> Self {
        Self::new(Place { regime: Regime::Reverse, fraction: Fraction::ONE }, Duty::ONE, at)
    }

    const fn new(place: Place, duty: Duty, at: OperatingPoint) -> Self {
        let drive = Drive { mode: place.regime.mode(at.counter_clockwise()), duty };
        Self { regime: place.regime, drive, asked: across(place.regime, place.current(at), at) }
    }
}

/// The voltage across the motor for a current in a regime's direction, given as the voltage behind it.
const fn across(regime: Regime, current: f32, at: OperatingPoint) -> Voltage {
    let (emf, _) = at.volts();
    let voltage = match regime {
        Regime::Forward => emf + current,
        Regime::Braking | Regime::Reverse => emf - current,
    };
    Voltage::from_volts(if at.counter_clockwise() { -voltage } else { voltage })
}

/// How the duty is found within a regime.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DutyRule {
    /// Linear between the points, as in the paper.
    LinearDuty,
    /// Such that the mean current is linear between the points.
    #[default]
    LinearCurrent,
}

impl DutyRule {
    /// Both of them.
    pub const EACH: [Self; 2] = [Self::LinearCurrent, Self::LinearDuty];
}

/// A motor's scheme and duty rule, with what they need prepared.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Placer {
    scheme: Scheme,
    rule: DutyRule,
    current: LinearCurrent,
}

impl Placer {
    /// Prepares the constants of the winding and its bridge.
    pub fn new(winding: &Winding, bridge: &BridgeConstants, scheme: Scheme, rule: DutyRule) -> Self {
        Self { scheme, rule, current: LinearCurrent::new(winding, bridge) }
    }

    /// Regime, mode and duty of a control value at an operating point.
    pub fn place(&self, at: OperatingPoint, control: Control) -> Placement {
        match self.rule {
            DutyRule::LinearDuty => self.place_duty(self.scheme, at, control),
            DutyRule::LinearCurrent => place_current(&self.current, self.scheme, at, control),
        }
    }

    /// The same by the rule of linear duty, and by any scheme, as far as the bridge may be given such a duty.
    pub fn place_duty(&self, scheme: Scheme, at: OperatingPoint, control: Control) -> Placement {
        let Placement { regime, drive, asked } = place(scheme, at, control);
        Placement { regime, drive: Drive { duty: self.current.allowed(drive.duty), ..drive }, asked }
    }

    /// The control value that makes this voltage of the motor, or the nearest to it that the scheme can give: by
    /// linear duty another than by linear current.
    pub fn control(&self, at: OperatingPoint, voltage: Voltage) -> Control {
        let voltage = voltage.to_volts();
        if (self.scheme, self.rule) == (Scheme::A, DutyRule::LinearCurrent) {
            // The same as by the points, for less.
            return Control::saturating(
                (roundf(voltage / at.volts().1 * f32::from(Control::MAX.get())) as i32).into(),
            );
        }
        let (regime, share) = points::share(if at.counter_clockwise() { -voltage } else { voltage }, at);
        let share = match self.rule {
            DutyRule::LinearCurrent => share,
            DutyRule::LinearDuty => {
                self.current.duty(Place { regime, fraction: Fraction::from_f32(share) }, at).to_f32()
            }
        };
        clockwise(at, points::control(&Points::new(self.scheme, at), (regime, share)))
    }

    /// A bridge with limits to its duty was not given another one because of them.
    pub fn is_as_asked(&self, placement: Placement) -> bool {
        self.current.is_within(placement.drive.duty)
    }

    /// The voltage across the motor that stands for the mean current of a drive, asked for or not. With linear
    /// duty that is another than the placement's.
    pub fn flows(&self, at: OperatingPoint, Placement { regime, drive, .. }: Placement) -> Voltage {
        across(regime, self.current.current(regime, drive.duty, at), at)
    }
}

/// The control value as a motor that turns CW would be given it.
const fn clockwise(at: OperatingPoint, control: Control) -> Control {
    if at.counter_clockwise() { control.reversed() } else { control }
}

/// Regime, mode and duty of a control value at an operating point; the duty is linear between the
/// points (paper, section 1.3).
pub const fn place(scheme: Scheme, at: OperatingPoint, control: Control) -> Placement {
    let place = Points::new(scheme, at).place(clockwise(at, control));
    Placement::new(place, place.fraction.to_duty(), at)
}

/// Regime, mode and duty of a control value at an operating point; the motor's mean current is linear
/// between the points.
pub fn place_current(
    current: &LinearCurrent,
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
    Placement::new(place, current.duty(place, at), at)
}
