//! What a host's set-up of a motor makes of the motor's settings.

use crate::braking::Winding;
use crate::motor::{Report, Settings};
use crate::protocol::setup::{Condition, Setup};
use crate::units::Milliamperes;

/// The set-up that these settings have.
pub const fn of(settings: &Settings) -> Setup {
    let Settings { winding: Winding { emf, resistance, inductance }, scheme, duty, .. } = *settings;
    Setup { emf, resistance: Some(resistance), inductance, scheme, duty }
}

/// Settings for a set-up. What zero means is kept, what protects the motor, and what is known of the bridge; of the motion
/// nothing is.
pub(super) fn settings(setup: Setup, present: &Settings) -> Settings {
    let Setup { emf, resistance, inductance, scheme, duty } = setup;
    let winding = match resistance {
        Some(resistance) => Winding { emf, resistance, inductance },
        // A host that has no use for the resistance leaves the winding as it is.
        None => Winding { emf, ..present.winding },
    };
    let Settings { bridge, zero_power, on_fault, thermal, .. } = *present;
    Settings { bridge, duty, zero_power, on_fault, thermal, ..Settings::for_scheme(winding, scheme) }
}

/// How a motor and its bridge are, by its report.
pub(super) fn condition(report: &Report) -> Condition {
    let Report { current, measured, sense_line, heat, derated, faults, .. } = *report;
    let measured_ma = measured.map(magnitude);
    Condition {
        current,
        measured_ma,
        heat,
        derated,
        overheated: faults.overheated,
        bridge_fault: faults.bridge,
        sense_line,
    }
}

/// As far as 16 bits go.
pub(super) fn magnitude(current: Milliamperes) -> u16 {
    u16::try_from(current.get().unsigned_abs()).unwrap_or(u16::MAX)
}
