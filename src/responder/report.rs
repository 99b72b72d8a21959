//! What is told of motors and bus while they run, all at once.

use super::motor::MotorChannel;
use super::setup::magnitude;
use crate::braking::{Abscissa, OperatingPoint, Points};
use crate::motor::{Report, Setpoint};
use crate::protocol::report::{MotorReport, Told};
use crate::units::{Control, Millivolts};

/// Of one motor. `up_to_date` is whether the report includes the motor's newest set-point.
pub(super) fn of_motor(
    channel: &MotorChannel,
    report: &Report,
    up_to_date: bool,
    battery: Option<Millivolts>,
) -> MotorReport {
    let Report {
        regulator,
        control,
        regime,
        drive,
        current,
        load,
        heat,
        derated,
        settled,
        stalled,
        faults,
        ..
    } = *report;
    MotorReport {
        told: told(channel, report.setpoint),
        position: channel.counts(report),
        velocity: report.velocity.round_to_i16(),
        regulator,
        control,
        regime,
        drive,
        current,
        measured_ma: report.measured.map(magnitude),
        load,
        heat,
        enabled: channel.enabled(),
        settled: settled && up_to_date,
        stalled,
        derated,
        faults,
        points: battery.and_then(|battery| points(channel, report, battery)),
    }
}

/// In the host's counts.
fn told(channel: &MotorChannel, setpoint: Setpoint) -> Told {
    match setpoint {
        Setpoint::Disabled => Told::Off,
        Setpoint::FailSafe => Told::FailSafe,
        Setpoint::ConstantPower(control) => Told::Power(control),
        Setpoint::Velocity(velocity) => Told::Velocity(velocity.round()),
        Setpoint::Position { target, .. } => Told::Position(channel.told_counts(target)),
        Setpoint::Together(reference) => Told::Together(channel.told_counts(reference.position)),
        Setpoint::Identify { travel_limit } => Told::Identify(travel_limit),
    }
}

/// S, T, Z, G for the way the motor turns.
fn points(channel: &MotorChannel, report: &Report, battery: Millivolts) -> Option<[Control; 4]> {
    let settings = channel.settings();
    let at = OperatingPoint::new(settings.winding.emf.emf(report.velocity), battery)?;
    let Points { s, t, z, g } = Points::new(settings.scheme, at);
    let sign = if at.counter_clockwise() { -1 } else { 1 };
    Some([s, t, z, g].map(|point: Abscissa| Control::saturating(sign * point.round())))
}
