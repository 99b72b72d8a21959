//! Explains as text why a motor does not turn, from its hub's [report](motor_hub::extension::report). Also explains why
//! settings were not stored or firmware does not run, from [reports of states](motor_hub::extension::state).
//!
//! ```
//! use motor_hub_client::motor_hub::extension::report::{Commands, HubReport, MotorReport, ReportedSetpoint};
//! use motor_hub_client::motor_hub::supply::BusState;
//! use motor_hub_client::reasons::why_still;
//!
//! let motor = MotorReport { enabled: true, setpoint: ReportedSetpoint::Velocity(500), stalled: true, ..MotorReport::default() };
//! let hub = HubReport { bus: BusState::Quiet, motors: [motor].into_iter().collect(), ..HubReport::default() };
//! assert_eq!(why_still(&hub, 0), Some("stalled: the motor is driven and does not turn"));
//!
//! // A current limit that is too small for the load also stalls the motor.
//! let limited = MotorReport { current_limited: true, ..motor };
//! let limited = HubReport { motors: [limited].into_iter().collect(), ..hub.clone() };
//! assert_eq!(why_still(&limited, 0), Some("held by its current limit: the load needs more current"));
//!
//! // The report is older than the newest command, so the reason may have passed.
//! let commands = Some(Commands { included: 7, newest: 8 });
//! assert_eq!(why_still(&HubReport { commands, ..hub }, 0), None);
//! ```

use crate::update::Image;
use motor_hub::extension::report::{HubReport, MotorReport, ReportedSetpoint};
use motor_hub::extension::state::{StoreReport, UpdateReport};
use motor_hub::motor::EncoderFault;
use motor_hub::motor::Faults;
use motor_hub::store::{Outcome, Stored};
use motor_hub::supply::BusState;
use motor_hub::units::{Control, Milliamperes};
use motor_hub::update::{self, Booted, Phase};

/// Highest speed at which a motor counts as standing, in counts per second.
pub const STANDS_CPS: u16 = 3;

/// Why the last save, load or reset failed, or that it has not ended; `None` if it succeeded.
#[must_use]
pub const fn why_unsaved(report: &StoreReport) -> Option<&'static str> {
    match report.outcome {
        // The outcome is the one of an earlier access.
        _ if report.is_busy => Some("the hub has not finished: ask again for its stored settings"),
        Outcome::Done | Outcome::None => None,
        Outcome::NeedsErase => {
            Some("the hub must erase flash first, and a motor is enabled: disable all motors and try again")
        }
        Outcome::Refused => Some("the hub's memory refused the write, or has no room for it"),
        Outcome::Lost => Some("the written data does not read back: the hub's memory is worn or missing"),
    }
}

/// Returns a text that says what a hub has stored.
#[must_use]
pub fn stored_text(StoreReport { stored, number, version, .. }: &StoreReport) -> String {
    match stored {
        Stored::Nothing => "nothing".to_owned(),
        Stored::Whole => format!("save {number}"),
        Stored::OneCopy => format!("save {number}; one of its two copies is damaged or older: save again"),
        Stored::Later => {
            format!(
                "settings of a later firmware (version {version}), kept but not in force; a reset erases them"
            )
        }
        Stored::Damaged => "damaged data; a reset erases it".to_owned(),
    }
}

/// Why an image does not fit the hub's slot; `None` if the image fits.
#[must_use]
pub fn why_unfit(Image { bytes, origin: linked, .. }: &Image, report: &UpdateReport) -> Option<String> {
    let UpdateReport { origin, capacity, .. } = *report;
    if let Some(linked) = linked.filter(|linked| *linked != origin) {
        return Some(format!(
            "the image is linked to {linked:#010x}, but this hub's images begin at {origin:#010x}: build it for the bootloader"
        ));
    }
    if bytes.len() > capacity as usize {
        return Some(format!("the image has {} bytes; the hub's slot holds {capacity}", bytes.len()));
    }
    // The second vector is the address of the first instruction.
    let entry = bytes.get(4..8).and_then(|word| word.try_into().ok()).map_or(0, u32::from_le_bytes);
    (entry.wrapping_sub(origin) >= capacity).then(|| {
        format!(
            "the image's code begins at {entry:#010x}, outside this hub's slot of {origin:#010x} to {:#010x}: \
             the image is for another chip, or not built for the bootloader",
            origin.wrapping_add(capacity)
        )
    })
}

pub(crate) const NOT_CHECKED: &str =
    "the hub has not finished the check; it checks a signature only while all motors are disabled";

/// Why the hub does not start the image that it has received; `None` if the hub starts the image at its next reset.
#[must_use]
pub const fn why_not_armed(report: &UpdateReport) -> Option<&'static str> {
    match (report.phase, report.outcome) {
        (Phase::Armed, _) => None,
        (_, update::Outcome::Mismatch) => Some("the hub's flash reads back other bytes than were sent"),
        (_, update::Outcome::WrongSignature) => Some("the signature is not of this file by the hub's key"),
        (_, update::Outcome::Older) => {
            Some("the image is older than the hub's firmware: its rollback version is lower")
        }
        (_, update::Outcome::Refused) => Some("the hub's flash refused the write"),
        _ => Some(NOT_CHECKED),
    }
}

/// Why an update to the version `sent` has not succeeded after the restart; `None` if the new firmware runs and has
/// confirmed itself. `now` is the version that the hub reports.
#[must_use]
pub fn why_not_started(booted: Booted, sent: &str, now: &str) -> Option<String> {
    match booted {
        Booted::Reverted => Some(format!(
            "{sent} was refused by the bootloader or did not confirm itself, and the hub returned to the former firmware, {now}"
        )),
        Booted::OnTrial | Booted::Unknown => Some("the new firmware runs, but has not confirmed itself".to_owned()),
        Booted::Unconfirmable => Some(
            "the new firmware runs, but the flash of the hub refuses its confirmation: the next reset restores the firmware before"
                .to_owned(),
        ),
        Booted::Confirmed => (now != sent).then(|| format!("the hub runs {now}, but the image sent is {sent}")),
    }
}

/// Why a motor does not turn; if there are several reasons, the most basic one. `None` if the motor turns, if no reason
/// is known, or if the report is older than the newest command to an enabled motor.
#[must_use]
pub fn why_still(hub: &HubReport, motor: usize) -> Option<&'static str> {
    let motor = hub.motors.get(motor)?;
    if let Some(fault) = fault(motor) {
        return Some(fault);
    }
    // The speed of a stalled motor is an estimate, which may differ from 0.
    if motor.velocity.unsigned_abs() > STANDS_CPS && !motor.stalled {
        return None;
    }
    // The reasons below depend on the reported set-point, which a newer command may have replaced.
    if motor.enabled && !hub.is_up_to_date() {
        return None;
    }
    match motor.setpoint {
        ReportedSetpoint::FailSafe => {
            return Some("fail-safe: the host was silent, and the hub disabled the motor");
        }
        _ if !motor.enabled => return Some("disabled"),
        ReportedSetpoint::Off => return Some("no target set for this mode"),
        _ => (),
    }
    if let Some(supply) = supply(hub.bus) {
        return Some(supply);
    }
    match motor.setpoint {
        ReportedSetpoint::Power(Control::ZERO) => Some("the set-point is power 0"),
        ReportedSetpoint::Velocity(0) => Some("the set-point is speed 0"),
        ReportedSetpoint::Position(_) | ReportedSetpoint::Follow(_) if motor.settled => {
            Some("settled at its target")
        }
        ReportedSetpoint::Identify(_) => None,
        ReportedSetpoint::Current(Milliamperes::ZERO) => Some("the set-point is current 0"),
        _ if motor.current_limited => Some("held by its current limit: the load needs more current"),
        _ if motor.stalled => Some("stalled: the motor is driven and does not turn"),
        _ if motor.derated => Some("derated: the winding is hot, and the current is limited"),
        ReportedSetpoint::Current(_) => Some("the load balances the constant current"),
        _ => None,
    }
}

const fn fault(motor: &MotorReport) -> Option<&'static str> {
    let regulated = matches!(
        motor.setpoint,
        ReportedSetpoint::Current(_)
            | ReportedSetpoint::Velocity(_)
            | ReportedSetpoint::Position(_)
            | ReportedSetpoint::Follow(_)
    );
    // Each fault is named, so that a new fault must get its reason here.
    let Faults { bridge, overheated, encoder, battery_unknown, encoder_stale } = motor.faults;
    if bridge {
        return Some("the bridge switched itself off: disable the motor, then enable it again");
    }
    if overheated {
        return Some("the winding is too hot: disable the motor, and let it cool before enabling it again");
    }
    match encoder {
        Some(EncoderFault::Stuck) => Some(
            "no counts although driven: the shaft is held, or the encoder is unplugged; \
             check both, disable the motor, then enable it again",
        ),
        Some(EncoderFault::Reversed) => Some(
            "counts go against the drive voltage: the load exceeds the stall torque, or motor leads or encoder wires are \
             swapped; check load and wiring, disable the motor, then enable it again",
        ),
        None if battery_unknown && motor.enabled => {
            Some("the battery voltage is unknown: check the battery and its switch")
        }
        None if encoder_stale && regulated => Some("the hub gets no reading from the encoder"),
        None => None,
    }
}

const fn supply(bus: BusState) -> Option<&'static str> {
    match bus {
        BusState::NoReading => Some("the battery voltage is unknown: check the battery and its switch"),
        BusState::TooLow => Some("the battery voltage is below what the bridges need"),
        BusState::Cutoff => Some("the battery voltage is too low: the hub draws no current"),
        BusState::TooHigh => Some("the bus voltage is too high, raised by another source than these motors"),
        BusState::Derated | BusState::Quiet | BusState::Dissipating => None,
    }
}
