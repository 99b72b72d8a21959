//! A scenario's run beside the same run without a braking regime: tables, JSON, charts and CSV.

mod csv;
mod figures;
mod tables;

use crate::chart;
use crate::measures::Measures;
use crate::scenario::{DutyChoice, Scenario};
use crate::scheme;
use crate::trace::Trace;
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};

/// What the run without a braking regime is called.
const WITHOUT: &str = "no braking regime";

/// Both runs of a scenario.
pub struct Comparison {
    scenario: Scenario,
    as_set: Trace,
    without: Trace,
    /// By motor: as set, and without a braking regime.
    measures: Vec<[Measures; 2]>,
}

/// One motor in the JSON report.
#[derive(Serialize)]
struct MotorReport<'a> {
    label: &'a str,
    motor: &'a str,
    scheme: String,
    duty: DutyChoice,
    as_set: &'a Measures,
    without_braking_regime: &'a Measures,
}

impl Comparison {
    /// Compares the trace of a scenario with that of [`Scenario::without_braking`].
    pub fn new(scenario: Scenario, as_set: Trace, without: Trace) -> Self {
        let measures = scenario.motors.iter().enumerate().map(|(index, motor)| {
            [&as_set, &without].map(|trace| Measures::new(motor, scenario.duration_s, trace, index))
        });
        let measures = measures.collect();
        Self { scenario, as_set, without, measures }
    }

    /// The tables for people.
    pub fn tables(&self) -> String {
        tables::all(self)
    }

    /// The document for programs.
    pub fn json(&self, files: &[PathBuf]) -> serde_json::Value {
        let motors = self.scenario.motors.iter().zip(&self.measures);
        let motors: Vec<_> = motors
            .map(|(motor, [as_set, without])| MotorReport {
                label: &motor.label,
                motor: motor.constants.name,
                scheme: scheme::describe(motor.scheme),
                duty: motor.duty,
                as_set,
                without_braking_regime: without,
            })
            .collect();
        json!({
            "scenario": self.scenario.name,
            "duration_s": self.scenario.duration_s,
            "control_period_ms": self.scenario.period.as_millis(),
            "seed": self.scenario.seed,
            "motors": motors,
            "files": files,
        })
    }

    /// Draws everything, then writes it to `folder`; returns what was written.
    ///
    /// # Errors
    /// If a chart cannot be drawn or a file not be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, String> {
        let mut files = vec![
            ("trace.csv".to_owned(), csv::of(&self.scenario, &self.as_set).into_bytes()),
            ("trace-none.csv".to_owned(), csv::of(&self.scenario, &self.without).into_bytes()),
        ];
        files.extend(drawn(&figures::all(self))?);
        write_all(folder, files)
    }
}

/// Charts as files: each as SVG and as PNG.
///
/// # Errors
/// If a chart cannot be drawn.
pub fn drawn(figures: &[(String, chart::Figure)]) -> Result<Vec<(String, Vec<u8>)>, String> {
    let mut files = Vec::with_capacity(2 * figures.len());
    for (name, figure) in figures {
        let svg = figure.svg();
        files.push((format!("{name}.png"), chart::png(&svg)?));
        files.push((format!("{name}.svg"), svg.into_bytes()));
    }
    Ok(files)
}

/// Writes files to a folder that it makes if need be; returns their paths.
///
/// # Errors
/// If the folder cannot be made or a file not be written.
pub fn write_all(folder: &Path, files: Vec<(String, Vec<u8>)>) -> Result<Vec<PathBuf>, String> {
    let failed = |path: &Path, e: std::io::Error| format!("{}: {e}", path.display());
    std::fs::create_dir_all(folder).map_err(|e| failed(folder, e))?;
    let mut written = Vec::with_capacity(files.len());
    for (name, bytes) in files {
        let path = folder.join(name);
        std::fs::write(&path, bytes).map_err(|e| failed(&path, e))?;
        written.push(path);
    }
    written.sort();
    Ok(written)
}
