//! Converts reports of a hub to dictionaries. Their keys are the fields of the dataclasses in `motor_hub/__init__.py`.

use motor_hub_client::base::{OdometryValues, most_counts};
use motor_hub_client::motor_hub::extension::base::OdometryReport;
use motor_hub_client::motor_hub::extension::report::{HubReport, MotorReport};
use motor_hub_client::motor_hub::group::BaseSettings;
use motor_hub_client::motor_hub::protocol::answers::Bulk;
use motor_hub_client::motor_hub::regulator::identify::Identified;
use motor_hub_client::motor_values::MotorValues;
use motor_hub_client::reasons::why_still;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Returns the readings of a hub of this project: the fields of `Reading` for each motor.
pub(crate) fn of_report<'py>(py: Python<'py>, report: &HubReport) -> PyResult<Vec<Bound<'py, PyDict>>> {
    report.motors.iter().enumerate().map(|(number, motor)| of_motor(py, report, number, motor)).collect()
}

fn of_motor<'py>(
    py: Python<'py>,
    report: &HubReport,
    number: usize,
    motor: &MotorReport,
) -> PyResult<Bound<'py, PyDict>> {
    let reading = PyDict::new(py);
    reading.set_item("time_s", f64::from(report.at_ms) / 1e3)?;
    reading.set_item("motor", number)?;
    reading.set_item("position", motor.position)?;
    reading.set_item("velocity", motor.velocity)?;
    reading.set_item("setpoint", motor.setpoint.name())?;
    reading.set_item("setpoint_value", motor.setpoint.value())?;
    reading.set_item("enabled", motor.enabled)?;
    reading.set_item("settled", motor.settled)?;
    reading.set_item("stalled", motor.stalled)?;
    reading.set_item("fault", motor.faults.any())?;
    reading.set_item("why_still", why_still(report, number))?;
    let values = MotorValues::of(motor);
    reading.set_item("regime", values.regime)?;
    reading.set_item("mode", values.mode)?;
    reading.set_item("duty", values.duty)?;
    reading.set_item("control", values.control)?;
    reading.set_item("current_a", values.current_a)?;
    reading.set_item("load_a", values.load_a)?;
    reading.set_item("heat", values.heat)?;
    reading.set_item("battery_v", report.battery.map(|battery| f64::from(battery.get()) / 1e3))?;
    Ok(reading)
}

/// Returns the readings of a hub that sends no reports (another maker's, or older firmware). The dictionaries lack the
/// fields that such a hub does not know.
pub(crate) fn of_bulk<'py>(py: Python<'py>, bulk: &Bulk) -> PyResult<Vec<Bound<'py, PyDict>>> {
    let readings = bulk.encoders.iter().zip(&bulk.velocities).enumerate();
    readings
        .map(|(number, (position, velocity))| {
            let reading = PyDict::new(py);
            reading.set_item("motor", number)?;
            reading.set_item("position", position)?;
            reading.set_item("velocity", velocity)?;
            Ok(reading)
        })
        .collect()
}

/// Returns the fields of `Identified`.
pub(crate) fn identified<'py>(py: Python<'py>, found: &Identified) -> PyResult<Bound<'py, PyDict>> {
    let fields = PyDict::new(py);
    fields.set_item("acceleration_per_volt", found.dynamics.gain.to_f32())?;
    fields.set_item("decay_per_s", found.dynamics.decay.to_f32())?;
    fields.set_item("friction_v", found.dynamics.friction.to_volts())?;
    fields.set_item("acceleration_error", f64::from(found.gain_error) / 1e3)?;
    fields.set_item("decay_error", f64::from(found.decay_error) / 1e3)?;
    fields.set_item("residual", f64::from(found.residual) / 1e3)?;
    Ok(fields)
}

/// Returns the fields of `Base`.
pub(crate) fn base<'py>(py: Python<'py>, base: &BaseSettings) -> PyResult<Bound<'py, PyDict>> {
    let geometry = base.geometry();
    let fields = PyDict::new(py);
    fields.set_item("wheels", <(u8, u8)>::from(base.wheels))?;
    fields.set_item("wheel_diameter_mm", geometry.wheel_diameter_mm)?;
    fields.set_item("track_mm", geometry.track_mm)?;
    fields.set_item("counts_per_turn", <(f64, f64)>::from(geometry.counts_per_turn))?;
    fields.set_item("use_gyro", base.use_gyro)?;
    fields.set_item("_counts_per_mm", most_counts(&geometry, 1.0))?;
    Ok(fields)
}

/// Returns the fields of `Odometry`.
pub(crate) fn odometry<'py>(py: Python<'py>, report: &OdometryReport) -> PyResult<Bound<'py, PyDict>> {
    let fields = PyDict::new(py);
    let values = OdometryValues::of(report);
    fields.set_item("x_mm", values.x_mm)?;
    fields.set_item("y_mm", values.y_mm)?;
    fields.set_item("heading_degrees", values.heading_degrees)?;
    fields.set_item("gyro", values.gyro)?;
    fields.set_item("gyro_losses", values.gyro_losses)?;
    Ok(fields)
}
