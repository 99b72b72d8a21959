//! What a supply that cannot give or take all leaves of a placement, and what a braking motor returns to it.

use super::points::{Fraction, OperatingPoint, Place, Regime};
use super::{Placement, Placer};
use crate::bridge::Drive;
use crate::units::single::at_most;
use crate::units::{Duty, Share, Voltage};
use libm::sqrtf;

/// Shares of the back EMF by which a motor is driven beyond it between two shorts: as much as takes from the bus what its
/// winding gives back when a short ends, and where all is to be burnt.
const BEYOND: f32 = 0.1;
const BEYOND_AT_ALL: f32 = 0.3;

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

    /// What takes from the bus between two shorts of a motor that brakes without returning anything: driving a little
    /// beyond its back EMF, the further the larger the share. `None` where the bus cannot push so far.
    pub fn beyond_emf(&self, share: Share, at: OperatingPoint) -> Option<Placement> {
        let (e, v) = at.volts();
        let most = v - e;
        if most <= BEYOND * e {
            return None;
        }
        let beyond = at_most(e * (BEYOND + (BEYOND_AT_ALL - BEYOND) * share.to_f32()), most);
        let place = Place { regime: Regime::Forward, fraction: Fraction::from_f32(beyond / most) };
        Some(Placement::new(place, self.current.duty(place, at), at))
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
