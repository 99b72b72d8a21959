//! The values of a motor that only hubs of this project report, for people and programs: SI units, counts and shares.
//! `client watch`, the dashboard and the Python package show these values.

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
    /// Points S, T, Z and G, as `control`; `None` if the battery voltage is unknown.
    pub points: Option<[f64; 4]>,
    /// Regime: `forward`, `braking` or `reverse`; `None` while the bridge is open.
    pub regime: Option<&'static str>,
    /// Mode of the bridge: `9/8`, `6/2` or `5/0`; `None` while the bridge is open.
    pub mode: Option<&'static str>,
    /// Duty of the bridge, 0 to 1.
    pub duty: f64,
    /// Mean current in A: measured, with the sign of the modelled current; modelled if the hub does not measure it.
    pub current_a: f64,
    /// Modelled mean current in A.
    pub modelled_a: f64,
    /// Magnitude of the measured mean current in A; `None` if the hub does not measure it.
    pub measured_a: Option<f64>,
    /// Current that would balance the load, in A; `None` for an unknown motor.
    pub load_a: Option<f64>,
    /// Heat of the winding as a share of its limit; 0 without a limit.
    pub heat: f64,
    /// True if the motor has settled at its target, or its group at its end.
    pub settled: bool,
    /// True if the motor is regulated, and a stop or a load holds the motor.
    pub stalled: bool,
    /// True if the winding is so hot that its current is limited.
    pub derated: bool,
    /// True if the motor's current limit holds its current down.
    pub current_limited: bool,
}

impl MotorValues {
    /// The values of a report.
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
