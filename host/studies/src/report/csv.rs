//! A trace as comma-separated values: one row for each motor and control tick.

use crate::SCHEMA_VERSION;
use crate::expectations::fault_words;
use crate::measures::regime_of;
use crate::table::without_negative_zero;
use motor_hub::motor::{Faults, Setpoint};
use simulated::scenario::Scenario;
use simulated::scenario::expectation::regime_name;
use simulated::trace::{Sample, Trace};
use std::fmt::Write;

/// The first line of the file. Units are in the names.
const HEADINGS: &str = "time_s,motor,label,battery_v,battery_measured_v,setpoint,setpoint_value,\
position_counts,speed_cps,speed_estimate_cps,control,regime,mode,duty,mean_current_a,\
energy_from_battery_j,energy_to_battery_j,external_torque_nm,settled,stalled,fault,encoder_fault,regulator,observed_load_a,schema_version\n";

/// The whole trace. Means and energies of a row are from its control tick to the next control tick. The energies of the
/// first tick include the energies before it.
pub(super) fn of(scenario: &Scenario, trace: &Trace) -> String {
    let mut out = HEADINGS.to_owned();
    for (number, tick) in trace.ticks.iter().enumerate() {
        for (index, (sample, motor)) in tick.motors.iter().zip(&scenario.motors).enumerate() {
            let mut sample = *sample;
            if let Some(before) = trace.before.get(index).filter(|_| number == 0) {
                sample.flow.energy_from_battery.0 += before.energy_from_battery.0;
                sample.flow.energy_to_battery.0 += before.energy_to_battery.0;
            }
            let measured = tick.measured_v.map(|v| format!("{v:.3}")).unwrap_or_default();
            let label = quoted(&motor.label);
            // Writing to a String cannot fail.
            let _ = write!(out, "{:.3},{},{label},{:.4},{measured},", tick.at_s, index, tick.battery_v);
            row(&mut out, &sample);
        }
    }
    out
}

fn row(out: &mut String, sample: &Sample) {
    let report = &sample.report;
    let (kind, value) = match report.setpoint {
        Setpoint::Disabled => ("disabled", String::new()),
        Setpoint::FailSafe => ("fail-safe", String::new()),
        Setpoint::ConstantPower(power) => ("power", power.get().to_string()),
        Setpoint::Current { current, .. } => ("current", current.to_amperes().to_string()),
        Setpoint::Velocity(cps) => ("velocity", cps.to_f64().to_string()),
        Setpoint::Position { target, .. } => ("position", target.to_string()),
        Setpoint::Identify { travel_limit } => ("identify", travel_limit.to_string()),
        Setpoint::Follow(reference) => ("together", reference.position.to_string()),
    };
    // An encoder fault is latched, so another fault may exist beside it.
    let others = Faults { encoder: None, ..report.faults };
    let of_encoder = Faults { encoder: report.faults.encoder, ..Faults::NONE };
    let [fault, encoder_fault] =
        [others, of_encoder].map(|faults| fault_words(faults).next().unwrap_or_default().replace('_', " "));
    let load = report.load.map(|load| format!("{:.3}", f64::from(load.get()) / 1e3)).unwrap_or_default();
    let values = format!(
        "{kind},{value},{},{:.3},{:.3},{},{},{},{:.5},{:.5},{:.6},{:.6},{},{},{},{fault},{encoder_fault},{},{load},{SCHEMA_VERSION}",
        sample.counts,
        sample.speed_cps,
        report.velocity.to_f64(),
        sample.control.get(),
        regime_name(regime_of(report)),
        report.drive.mode.name(),
        report.drive.duty.to_f64(),
        sample.flow.mean_current().0,
        sample.flow.energy_from_battery.0,
        sample.flow.energy_to_battery.0,
        sample.torque_nm,
        report.settled,
        report.stalled,
        report.regulator.name(),
    );
    out.push_str(&without_negative_zero(&values));
    out.push('\n');
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motor_hub::braking::Regime;
    use motor_hub::bridge::Drive;
    use motor_hub::motor::Report;
    use motor_hub::units::Control;

    #[test]
    fn an_open_bridge_coasts_also_in_the_braking_regime() {
        let report = Report { regime: Some(Regime::Braking), drive: Drive::COAST, ..Report::INITIAL };
        let control = Control::ZERO;
        let sample =
            Sample { report, control, speed_cps: 0.0, counts: 0, torque_nm: 0.0, flow: Default::default() };
        let mut written = String::new();
        row(&mut written, &sample);
        let mut columns =
            HEADINGS.split(',').skip_while(|heading| *heading != "setpoint").zip(written.split(','));
        assert_eq!(columns.find(|(heading, _)| *heading == "regime"), Some(("regime", "coast")));
    }
}
