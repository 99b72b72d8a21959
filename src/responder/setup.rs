//! What a host's set-up of a motor makes of the motor's settings.

use crate::braking::Winding;
use crate::motor::Settings;
use crate::protocol::setup::Setup;

/// The set-up that these settings have.
pub const fn of(settings: &Settings) -> Setup {
    let Settings { winding: Winding { emf, resistance, inductance }, scheme, duty, .. } = *settings;
    Setup { emf, resistance: Some(resistance), inductance, scheme, duty }
}

/// Settings for a set-up. What zero and a fault mean is kept, and what is known of the bridge; of the motion
/// nothing is.
pub(super) fn settings(setup: Setup, present: &Settings) -> Settings {
    let Setup { emf, resistance, inductance, scheme, duty } = setup;
    let winding = match resistance {
        Some(resistance) => Winding { emf, resistance, inductance },
        // A host that has no use for the resistance leaves the winding as it is.
        None => Winding { emf, ..present.winding },
    };
    let Settings { bridge, zero_power, on_fault, .. } = *present;
    Settings { bridge, duty, zero_power, on_fault, ..Settings::for_scheme(winding, scheme) }
}
