//! Values of a motor that only hubs of this project report, in SI units, counts and ratios. `client watch`, the
//! dashboard and the Python package show these values.

use motor_hub::braking::Regime;
use motor_hub::extension::report::MotorReport;
use motor_hub::units::{Control, Milliamperes};
use serde::Serialize;

/// Values of a motor at a control tick.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MotorValues {
    /// Regulator of the motor: `model`, or `PID` with coefficients of a host.
    pub regulator: &'static str,
    /// Control value as a share of full control, -1 to 1.
    pub control: f64,
    /// Points S, T, Z and G of the scheme as shares of full control; `None` if the battery voltage is unknown.
    pub points: Option<[f64; 4]>,
    /// Regime: `forward`, `braking` or `reverse`; `None` while the bridge is open.
    pub regime: Option<&'static str>,
    /// Mode of the bridge: `9/8`, `6/2` or `5/0`; `None` while the bridge is open.
    pub mode: Option<&'static str>,
    /// Duty of the bridge, 0 to 1.
    pub duty: f64,
    /// Best known mean current in A. This is the measured current with the sign of the modelled current, or the
    /// modelled current without a measurement.
    pub current_a: f64,
    /// Modelled mean current in A.
    pub modelled_a: f64,
    /// Magnitude of the measured mean current in A. `None` without a sound current-sense line, and while the bridge is
    /// in mode 5/0.
    pub measured_a: Option<f64>,
    /// Current in A that would balance load, friction and drag; `None` for an unknown motor.
    pub load_a: Option<f64>,
    /// Heat of the winding as a share of its thermal limit; 0 without a thermal limit.
    pub heat: f64,
    /// True if the motor has settled at its target position, or if all members of its group have settled. Always false
    /// at a velocity.
    pub settled: bool,
    /// True if the motor is regulated, and a mechanical stop or a load keeps the motor from moving.
    pub stalled: bool,
    /// True if the current is limited because the winding is hot.
    pub derated: bool,
    /// True if the motor's current limit reduces the current.
    pub current_limited: bool,
}

impl MotorValues {
    /// Returns the values of a report.
    pub fn of(report: &MotorReport) -> Self {
        Self {
            regulator: report.regulator.name(),
            control: report.control.to_f64(),
            points: report.points.map(|points| points.map(Control::to_f64)),
            regime: report.regime.map(Regime::name),
            mode: report.regime.map(|_| report.drive.mode.name()),
            duty: report.drive.duty.to_f64(),
            current_a: amperes(report.best_current()),
            modelled_a: amperes(report.current),
            measured_a: report.measured_ma.map(|ma| f64::from(ma) / 1e3),
            load_a: report.load.map(amperes),
            heat: f64::from(report.heat) / 1e3,
            settled: report.settled,
            stalled: report.stalled,
            derated: report.derated,
            current_limited: report.current_limited,
        }
    }
}

fn amperes(current: Milliamperes) -> f64 {
    f64::from(current.get()) / 1e3
}
