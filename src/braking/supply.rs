//! What a supply that cannot give or take all leaves of a placement, and what a braking motor returns to it.

use super::points::{Fraction, OperatingPoint, Place, Regime};
use super::{Placement, Placer};
use crate::bridge::Drive;
use crate::units::{Duty, Share, Voltage};
use libm::sqrtf;

/// A motor whose back EMF is more than this share of the bus's voltage brakes in 6/2; a slower one is started by it.
const BRAKES: f32 = 0.125;

/// What a braking motor does with its energy of motion, in watts, each at least 0.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Returned {
    /// Goes back to the bus.
    pub returned: f32,
    /// Heats winding and bridge.
    pub burnt: f32,
}

impl Returned {
    /// It does not brake.
    pub const NONE: Self = Self { returned: 0.0, burnt: 0.0 };
}

impl Placer {
    /// A placement with no more drawn from the bus than this share of what a motor at standstill would draw at full
    /// duty. [`Share::NONE`] leaves braking: dynamic for reverse driving, an open bridge for forward driving.
    #[must_use]
    pub fn drawing_at_most(&self, placement: Placement, share: Share, at: OperatingPoint) -> Placement {
        if share == Share::ALL || placement.regime == Regime::Braking {
            return placement;
        }
        let forward = placement.regime == Regime::Forward;
        if share == Share::NONE {
            let open = Place { regime: Regime::Braking, fraction: Fraction::ZERO };
            return if forward { Placement::new(open, Duty::ZERO, at) } else { Placement::full_braking(at) };
        }
        // A bridge at duty D pushes D V, through the winding, against e, and draws D of that current:
        // D (D V -+ e) = share V.
        let (e, v) = at.volts();
        let e = if forward { e } else { -e };
        let most = (e + sqrtf(e * e + 4.0 * share.to_f32() * v * v)) / (2.0 * v);
        let most = Duty::from_bits((32_768.0 * most.min(1.0)) as u16);
        if most >= placement.drive.duty { placement } else { self.with_duty(placement, most) }
    }

    /// A placement so far on the way to full dynamic braking, which returns nothing: 5/0 fades to a full short, and a
    /// motor that is braked by 6/2 is less and less so, down to the same. A bridge that is open stays so.
    #[must_use]
    pub fn burning(&self, placement: Placement, share: Share, at: OperatingPoint) -> Placement {
        let bits = u32::from(placement.drive.duty.to_bits());
        if share == Share::NONE || bits == 0 {
            return placement;
        }
        let (e, v) = at.volts();
        let part = |whole: u32| (whole * u32::from(share.to_bits())) >> 15;
        let faded = match placement.regime {
            Regime::Braking => bits + part(32_768 - bits),
            Regime::Reverse if e > BRAKES * v && share == Share::ALL => return Placement::full_braking(at),
            Regime::Reverse if e > BRAKES * v => bits - part(bits),
            _ => return placement,
        };
        self.with_duty(placement, Duty::from_bits(faded as u16))
    }

    /// As near to it as the bridge may be given.
    fn with_duty(&self, placement: Placement, duty: Duty) -> Placement {
        let drive = Drive { duty: self.current.allowed(duty), ..placement.drive };
        Placement { drive, ..placement }
    }

    /// What becomes of the energy of a motor that brakes, whose winding and bridge have so many ohms together:
    /// from the voltage that stands for its mean current, the volt seconds of a winding, and what is left.
    pub fn returned(&self, at: OperatingPoint, placement: Placement, flows: Voltage, ohms: f32) -> Returned {
        if placement.regime == Regime::Forward {
            return Returned::NONE;
        }
        let (e, v) = at.volts();
        let flows = flows.to_volts();
        let across = if at.counter_clockwise() { -flows } else { flows };
        let current = (e - across).max(0.0) / ohms;
        let moving = e * current;
        if placement.regime == Regime::Reverse {
            return Returned { returned: 0.0, burnt: moving };
        }
        // While the bridge is open the current falls against the bus: in continuous conduction for all of that time,
        // else until as many volt seconds are gone as the short had brought.
        let open = 1.0 - placement.drive.duty.to_f32();
        let share = open.min(e / self.current.bus(v));
        let returned = (v * current * share).min(moving);
        Returned { returned, burnt: moving - returned }
    }
}
