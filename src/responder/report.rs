//! Builds the reports of the extension from a snapshot and from the channels of the motors.

use super::motor::MotorChannel;
use crate::braking::{OperatingPoint, Points, UnboundedControl};
use crate::extension::report::{Condition, MotorReport, ReportedSetpoint};
use crate::motor::{Report, Setpoint};
use crate::units::{Control, Milliamperes, Millivolts};

/// Returns the state of one motor. `up_to_date` is true if `report` includes the motor's newest set-point. If false,
/// the motor is not reported as settled.
pub(super) fn of_motor(
    channel: &MotorChannel,
    report: &Report,
    up_to_date: bool,
    battery: Option<Millivolts>,
) -> MotorReport {
    let Report {
        regulator,
        regime,
        drive,
        current,
        load,
        heat,
        derated,
        current_limited,
        settled,
        stalled,
        faults,
        ..
    } = *report;
    MotorReport {
        setpoint: setpoint(channel, report.setpoint),
        position: channel.counts(report),
        velocity: report.velocity.round_to_i16(),
        regulator,
        control: report.control(&channel.settings().motor),
        regime,
        drive,
        current,
        measured_ma: report.measured.map(Milliamperes::magnitude),
        load,
        heat,
        enabled: channel.enabled(),
        settled: settled && up_to_date,
        stalled,
        derated,
        current_limited,
        faults,
        points: battery.and_then(|battery| points(channel, report, battery)),
    }
}

fn setpoint(channel: &MotorChannel, setpoint: Setpoint) -> ReportedSetpoint {
    match setpoint {
        Setpoint::Disabled => ReportedSetpoint::Off,
        Setpoint::FailSafe => ReportedSetpoint::FailSafe,
        Setpoint::ConstantPower(control) => ReportedSetpoint::Power(control),
        Setpoint::Current { current, .. } => ReportedSetpoint::Current(current),
        Setpoint::Velocity(velocity) => ReportedSetpoint::Velocity(velocity.round()),
        Setpoint::Position { target, .. } => ReportedSetpoint::Position(channel.host_counts(target)),
        Setpoint::Follow(reference) => ReportedSetpoint::Follow(channel.host_counts(reference.position)),
        Setpoint::Identify { travel_limit } => ReportedSetpoint::Identify(travel_limit),
    }
}

/// Returns the points S, T, Z and G of the scheme, with the sign of the motor's direction. `None` if the battery
/// voltage is 0.
fn points(channel: &MotorChannel, report: &Report, battery: Millivolts) -> Option<[Control; 4]> {
    let settings = &channel.settings().motor;
    let at = OperatingPoint::new(settings.winding.emf.emf(report.velocity), battery)?;
    let Points { s, t, z, g } = Points::new(settings.scheme, at);
    let sign = if at.counter_clockwise() { -1 } else { 1 };
    Some([s, t, z, g].map(|point: UnboundedControl| Control::saturating(sign * point.round())))
}

/// Returns the state of a motor and its bridge.
pub(super) fn condition(report: &Report) -> Condition {
    let Report { current, measured, sense_line, heat, derated, emf_constant, faults, .. } = *report;
    Condition {
        current,
        measured_ma: measured.map(Milliamperes::magnitude),
        heat,
        derated,
        overheated: faults.overheated,
        bridge_fault: faults.bridge,
        sense_line,
        emf_constant,
    }
}
