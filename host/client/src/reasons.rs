//! Explains as text why a motor does not turn, from its hub's [report](motor_hub::extension::report). Also explains why
//! settings were not stored, from the [report of the store](motor_hub::extension::state::StoreReport).
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
//! // Without current a motor may still turn, for example by its load.
//! let turning = MotorReport { velocity: 300, stalled: false, ..motor };
//! let low = HubReport { bus: BusState::Cutoff, motors: [turning].into_iter().collect(), ..hub.clone() };
//! assert_eq!(why_still(&low, 0), Some("the battery voltage is too low: the hub draws no current"));
//!
//! // The report is older than the newest command, so the reason may have passed.
//! let commands = Some(Commands { included: 7, newest: 8 });
//! assert_eq!(why_still(&HubReport { commands, ..hub }, 0), None);
//! ```

use motor_hub::extension::report::{HubReport, MotorReport, ReportedSetpoint};
use motor_hub::extension::state::StoreReport;
use motor_hub::motor::EncoderFault;
use motor_hub::motor::Faults;
use motor_hub::store::{Outcome, Stored};
use motor_hub::supply::BusState;
use motor_hub::units::{Control, Milliamperes};

/// Highest speed at which a motor counts as standing, in counts per second.
pub const STANDSTILL_SPEED_CPS: u16 = 3;

/// Why the last save, load or reset failed, or that it has not ended; `None` if it succeeded. A hub that was reset has
/// had no access since then, so its access before the reset counts as failed.
#[must_use]
pub const fn why_unsaved(report: &StoreReport) -> Option<&'static str> {
    match report.outcome {
        // The outcome is the one of an earlier access.
        _ if report.is_busy => Some("the hub has not finished: ask again for its stored settings"),
        Outcome::Done => None,
        Outcome::None => {
            Some("the hub was reset before it had finished: look at its stored settings, and try again")
        }
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

/// Why a motor does not turn, or gets no current because of the battery; if there are several reasons, the most basic
/// one. `None` if a motor with current turns, if no reason is known, or if the report is older than the newest command to
/// an enabled motor.
#[must_use]
pub fn why_still(hub: &HubReport, motor: usize) -> Option<&'static str> {
    let motor = hub.motors.get(motor)?;
    if let Some(fault) = fault(motor) {
        return Some(fault);
    }
    if motor.enabled && matches!(hub.bus, BusState::NoReading | BusState::TooLow | BusState::Cutoff) {
        return supply(hub.bus);
    }
    // The speed of a stalled motor is an estimate, which may differ from 0.
    if motor.velocity.unsigned_abs() > STANDSTILL_SPEED_CPS && !motor.stalled {
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

/// Text that says what the state of the bus means for the motors.
#[must_use]
pub const fn bus_text(bus: BusState) -> &'static str {
    match bus {
        BusState::NoReading => "voltage unknown, motors coast",
        BusState::TooLow => "below what the bridges need, motors coast",
        BusState::Cutoff => "too low, motors draw no current",
        BusState::Derated => "low, motors draw less current",
        BusState::Quiet => "normal",
        BusState::Dissipating => "takes no energy back, braking motors dissipate it",
        BusState::TooHigh => "too high, raised by another source than these motors",
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
