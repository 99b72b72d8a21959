//! Readings of a hub while a host drives its motors: rows of comma-separated values, and a chart of each motor.
//!
//! ```
//! use motor_hub::extension::report::ReportedSetpoint;
//! use studies::recording::{Recording, Sample};
//!
//! let mut recording = Recording::new("bench", ReportedSetpoint::Velocity(500));
//! let sample = Sample { at_s: 0.02, motor: 0, battery_v: 12.5, position: 10, cps: 480, ..Sample::default() };
//! assert_eq!(recording.push(sample), "0.0200,0,12.500,velocity,500,10,480,,,,2\n");
//! assert_eq!(recording.figures().len(), 1);
//! ```

use crate::points::{CONTROL_RANGE, fraction};
use crate::{NamedFigure, SCHEMA_VERSION};
use chart::{Figure, Panel, Series, Style, colour};
use motor_hub::extension::report::ReportedSetpoint;

/// The first line of the file. Units are in the names; unknown values are empty.
pub const HEADINGS: &str = "time_s,motor,battery_measured_v,setpoint,setpoint_value,position_counts,\
speed_estimate_cps,control,current_a,settled,schema_version\n";

/// A hub's report of one motor at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Seconds since the start.
    pub at_s: f64,
    /// Number of the motor, from 0.
    pub motor: u8,
    /// Battery voltage that the hub measures.
    pub battery_v: f64,
    /// Encoder position in counts.
    pub position: i32,
    /// Speed in counts per second.
    pub cps: i16,
    /// Control value in steps; `None` if the hub does not report it.
    pub control: Option<i16>,
    /// Magnitude of the motor's current in amperes; `None` if the hub does not report it.
    pub current_a: Option<f64>,
    /// True if the motor has settled at its target; `None` if the hub does not report it.
    pub settled: Option<bool>,
}

/// A recorded run.
#[derive(Clone, Debug)]
pub struct Recording {
    subtitle: String,
    /// Set-point of all motors.
    setpoint: ReportedSetpoint,
    samples: Vec<Sample>,
}

impl Recording {
    /// An empty recording of motors with this set-point. Its charts have this subtitle.
    pub fn new(subtitle: &str, setpoint: ReportedSetpoint) -> Self {
        Self { subtitle: subtitle.to_owned(), setpoint, samples: Vec::new() }
    }

    /// Steps of a constant power; `None` for other set-points.
    const fn power(&self) -> Option<i16> {
        if let ReportedSetpoint::Power(control) = self.setpoint { Some(control.get()) } else { None }
    }

    /// Value of the set-point: steps, amperes, counts per second or counts.
    fn value(&self) -> f64 {
        self.power().map_or_else(|| self.setpoint.value().unwrap_or_default(), f64::from)
    }

    /// Keeps a sample, and returns its row.
    pub fn push(&mut self, sample: Sample) -> String {
        self.samples.push(sample);
        let Sample { at_s, motor, battery_v, position, cps, control, current_a, settled } = sample;
        let control = control.or(self.power()).map(|steps| steps.to_string()).unwrap_or_default();
        let current = current_a.map(|current| format!("{current:.3}")).unwrap_or_default();
        let settled = settled.map(|settled| settled.to_string()).unwrap_or_default();
        let (name, value) = (self.setpoint.name(), self.value());
        format!(
            "{at_s:.4},{motor},{battery_v:.3},{name},{value},{position},{cps},{control},{current},{settled},{SCHEMA_VERSION}\n"
        )
    }

    /// A chart of each motor with the panels of a simulated run. Values that the hub does not report have no panel.
    pub fn figures(&self) -> Vec<NamedFigure> {
        let mut motors: Vec<u8> = self.samples.iter().map(|sample| sample.motor).collect();
        motors.sort_unstable();
        motors.dedup();
        motors.into_iter().map(|motor| (format!("motor-{motor}"), self.figure(motor))).collect()
    }

    fn figure(&self, motor: u8) -> Figure {
        let line = |name: &str, colour, style, value: &dyn Fn(&Sample) -> f64| {
            let samples = self.samples.iter().filter(|s| s.motor == motor);
            Series::new(name, colour, style, samples.map(|s| (s.at_s, value(s))))
        };
        let target = |_: &Sample| self.value();
        let goal = || line("set-point", colour::RED, Style::DashedStep, &target);
        let mut panels = Vec::new();
        if matches!(self.setpoint, ReportedSetpoint::Position(_)) {
            let position = line("position", colour::INK, Style::Line, &|s| s.position.into());
            panels.push(Panel::new("position, counts", 150.0, vec![goal(), position]));
        }
        let speed = line("speed", colour::INK, Style::Line, &|s| s.cps.into());
        let is_velocity = matches!(self.setpoint, ReportedSetpoint::Velocity(_));
        let speeds = if is_velocity { vec![goal(), speed] } else { vec![speed] };
        panels.push(Panel::new("speed, counts/s", 170.0, speeds));
        let reported = self.samples.iter().any(|sample| sample.motor == motor && sample.control.is_some());
        if reported || self.power().is_some() {
            let value = |s: &Sample| s.control.or(self.power()).map_or(f64::NAN, fraction);
            let control = line("control", colour::BLUE, Style::Step, &value);
            panels
                .push(Panel { y_range: Some(CONTROL_RANGE), ..Panel::new("control", 130.0, vec![control]) });
        }
        if self.samples.iter().any(|sample| sample.motor == motor && sample.current_a.is_some()) {
            let current = line("current", colour::BLUE, Style::Step, &|s| s.current_a.unwrap_or(f64::NAN));
            panels.push(Panel::new(
                "magnitude of the motor current, A, as reported by the hub",
                110.0,
                vec![current],
            ));
        }
        let battery = line("as measured", colour::GREEN, Style::Line, &|s| s.battery_v);
        panels.push(Panel::new("battery, V", 80.0, vec![battery]));
        Figure {
            title: format!("motor {motor}: {} {}", self.setpoint.name(), self.value()),
            subtitle: self.subtitle.clone(),
            x_label: "time, s".into(),
            x_range: None,
            panels,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use motor_hub::units::{Control, Milliamperes};

    #[test]
    fn a_chart_has_a_panel_for_everything_that_is_known() {
        let labels = |setpoint, current_a| -> Vec<String> {
            let mut recording = Recording::new("", setpoint);
            let _ = recording.push(Sample { current_a, ..Sample::default() });
            let figures = recording.figures();
            figures.into_iter().flat_map(|(_, figure)| figure.panels).map(|panel| panel.y_label).collect()
        };
        assert_eq!(labels(ReportedSetpoint::Velocity(1), None), ["speed, counts/s", "battery, V"]);
        assert!(labels(ReportedSetpoint::Position(1), None).contains(&"position, counts".to_owned()));
        let everything = labels(ReportedSetpoint::Power(Control::new(1)), Some(0.5));
        assert!(everything.len() == 4 && everything[2].contains("current, A"), "{everything:?}");
    }

    #[test]
    fn a_row_has_as_many_fields_as_the_headings() {
        let mut recording = Recording::new("", ReportedSetpoint::Power(Control::new(-3)));
        let row = recording.push(Sample { current_a: Some(1.5), ..Sample::default() });
        assert_eq!(row.matches(',').count(), HEADINGS.matches(',').count());
        assert!(row.contains(",-3,1.500,"), "{row}");
        let row = recording.push(Sample { control: Some(7), ..Sample::default() });
        assert!(row.contains(",7,,"), "the hub's own value: {row}");
        let row =
            Recording::new("", ReportedSetpoint::Current(Milliamperes::new(-800))).push(Sample::default());
        assert!(row.contains(",current,-0.8,"), "{row}");
    }
}
