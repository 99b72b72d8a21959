//! Why a motor does not turn, in words, from what its hub [reports](motor_hub::protocol::report); and why settings were not
//! [stored](motor_hub::protocol::store).
//!
//! ```
//! use motor_hub_client::motor_hub::protocol::report::{HubReport, MotorReport, Told};
//! use motor_hub_client::motor_hub::supply::BusState;
//! use motor_hub_client::why::why_still;
//!
//! let motor = MotorReport { enabled: true, told: Told::Velocity(500), stalled: true, ..MotorReport::default() };
//! let hub = HubReport { bus: BusState::Quiet, motors: [motor].into_iter().collect(), ..HubReport::default() };
//! assert_eq!(why_still(&hub, 0), Some("held: it is driven and does not turn"));
//! ```

use motor_hub::motion::EncoderFault;
use motor_hub::motor::Faults;
use motor_hub::protocol::report::{HubReport, MotorReport, Told};
use motor_hub::protocol::store::StoreReport;
use motor_hub::store::Outcome;
use motor_hub::supply::BusState;
use motor_hub::units::Control;

/// Slower than this, in counts per second, a motor is taken to stand.
pub const STANDS_CPS: u16 = 3;

/// Why an order to the store that is over did not end as it should; `None` if it did.
#[must_use]
pub const fn why_unsaved(report: &StoreReport) -> Option<&'static str> {
    match report.outcome {
        Outcome::Done | Outcome::None => None,
        Outcome::NeedsErase => {
            Some("it needs an erasure, and a motor runs: disable all motors and try again")
        }
        Outcome::Refused => Some("the hub's memory refused"),
        Outcome::Lost => {
            Some("what was written does not read back: the hub's memory is worn, or it has none")
        }
    }
}

/// What keeps a motor from turning as it is told, the most basic reason first; `None` of one that turns and of one
/// that nothing keeps.
#[must_use]
pub fn why_still(hub: &HubReport, motor: usize) -> Option<&'static str> {
    let motor = hub.motors.get(motor)?;
    if let Some(fault) = fault(motor) {
        return Some(fault);
    }
    if motor.velocity.unsigned_abs() > STANDS_CPS {
        return None;
    }
    match motor.told {
        Told::FailSafe => return Some("let go: its host was gone"),
        _ if !motor.enabled => return Some("disabled"),
        Told::Off => return Some("no target yet for its mode"),
        _ => (),
    }
    if let Some(supply) = supply(hub.bus) {
        return Some(supply);
    }
    match motor.told {
        Told::Power(Control::ZERO) => Some("told to stand: power 0"),
        Told::Velocity(0) => Some("told to stand: velocity 0"),
        Told::Position(_) | Told::Together(_) if motor.at_target => Some("at its target"),
        Told::Identify(_) => None,
        _ if motor.stalled => Some("held: it is driven and does not turn"),
        _ if motor.derated => Some("its winding is hot, and its current limited"),
        _ => None,
    }
}

const fn fault(motor: &MotorReport) -> Option<&'static str> {
    let regulated = matches!(motor.told, Told::Velocity(_) | Told::Position(_) | Told::Together(_));
    match motor.faults {
        Faults { bridge: true, .. } => Some("its bridge switched itself off: disable it, then try again"),
        Faults { overheated: true, .. } => {
            Some("switched off, its winding is too hot: let it cool, disable it")
        }
        Faults { encoder: Some(EncoderFault::Stuck), .. } => {
            Some("its encoder does not count: look at its plug, then disable it")
        }
        Faults { encoder: Some(EncoderFault::Reversed), .. } => {
            Some("its encoder counts the wrong way: swap the motor's leads, then disable it")
        }
        Faults { battery_unknown: true, .. } if motor.enabled => Some("no battery: its voltage is not known"),
        Faults { encoder_stale: true, .. } if regulated => Some("its encoder is not read"),
        _ => None,
    }
}

const fn supply(bus: BusState) -> Option<&'static str> {
    match bus {
        BusState::Silent => Some("no battery: its voltage is not known"),
        BusState::TooLow => Some("the battery is below what bridges work at"),
        BusState::Cut => Some("the battery is too low: nothing is drawn from it"),
        BusState::TooHigh => Some("the bus is too high, lifted by something else than these motors"),
        BusState::Derated | BusState::Quiet | BusState::Burning => None,
    }
}
