//! Compares the run of a scenario by the flashed image on an emulated chip with its run on the simulated board: tables,
//! a chart, and the differences.
//!
//! ```
//! use simulated::{scenario::Scenario, sim};
//! use studies::overlay::Overlay;
//!
//! let scenario = Scenario { duration_s: 0.5, ..Scenario::default_one()? };
//! let trace = sim::run(&scenario, &mut |_| ())?;
//! // A run does not differ from itself.
//! let overlay = Overlay::new(scenario, "STM32F427", trace.clone(), trace);
//! assert!(overlay.apart().iter().all(|apart| apart.worst_cps == 0.0 && apart.worst_counts == 0));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

use crate::Lines;
use crate::measures::{Measures, extent, rms};
use crate::report::tables::side_by_side;
use chart::{Figure, Panel, Style, colour};
use simulated::scenario::Scenario;
use simulated::trace::{Sample, Trace};

/// Two traces of a scenario.
pub struct Overlay {
    scenario: Scenario,
    chip: &'static str,
    emulated: Trace,
    simulated: Trace,
}

/// Differences of the two runs for one motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Apart {
    /// Largest distance in counts/s of the chip's speed from the speeds of the simulation within one control period. A
    /// difference in time of one tick therefore does not count.
    pub worst_cps: f64,
    /// Root mean square of the difference in speed at the same tick, in counts/s.
    pub rms_cps: f64,
    /// Largest difference in position at the same tick, in counts.
    pub worst_counts: i64,
}

impl Overlay {
    /// Compares the traces of a scenario's two runs, the first on this emulated chip.
    pub const fn new(scenario: Scenario, chip: &'static str, emulated: Trace, simulated: Trace) -> Self {
        Self { scenario, chip, emulated, simulated }
    }

    /// The differences of the two runs, by motor.
    #[must_use]
    pub fn apart(&self) -> Vec<Apart> {
        (0..self.scenario.motors.len()).map(|motor| self.apart_of(motor)).collect()
    }

    fn apart_of(&self, motor: usize) -> Apart {
        let simulated: Vec<(f64, &Sample)> = self.simulated.motor(motor).collect();
        let period_s = f64::from(self.scenario.period.as_millis()) * 1e-3;
        let mut apart = Apart { worst_cps: 0.0, rms_cps: 0.0, worst_counts: 0 };
        let mut differences = Vec::new();
        for (at_s, emulated) in self.emulated.motor(motor) {
            let near = |within: f64| simulated.iter().filter(move |(other, _)| (other - at_s).abs() < within);
            for (_, other) in near(0.1 * period_s) {
                differences.push(emulated.speed_cps - other.speed_cps);
                apart.worst_counts = apart.worst_counts.max((emulated.counts - other.counts).abs());
            }
            let speeds = near(1.1 * period_s).map(|(_, other)| other.speed_cps);
            let (least, most) = extent(speeds).unwrap_or((f64::MAX, f64::MIN));
            let outside = (least - emulated.speed_cps).max(emulated.speed_cps - most);
            apart.worst_cps = apart.worst_cps.max(outside);
        }
        apart.rms_cps = rms(&differences);
        apart
    }

    /// The measures of both runs as tables, with their differences.
    pub fn tables(&self) -> String {
        let mut out = format!("{}: {} s\n", self.scenario.name, self.scenario.duration_s);
        for (index, (motor, apart)) in self.scenario.motors.iter().zip(self.apart()).enumerate() {
            let measures = [&self.emulated, &self.simulated]
                .map(|trace| Measures::new(motor, 0.0..self.scenario.duration_s, trace, index));
            let table = side_by_side(motor, ["emulated chip", "simulated board"], &measures);
            out += &format!(
                "{table}\nApart by at most {:.1} counts/s (rms {:.1}) and {} counts\n\n",
                apart.worst_cps, apart.rms_cps, apart.worst_counts
            );
        }
        out
    }

    /// A chart with speed and duty of every motor in both runs.
    pub fn figure(&self) -> Figure {
        let mut panels = Vec::new();
        for (index, motor) in self.scenario.motors.iter().enumerate() {
            let [emulated, simulated] =
                [&self.emulated, &self.simulated].map(|trace| Lines { trace, motor: index });
            // The dashed line is on top, so that both lines show where they coincide.
            let both = |[style, dashed]: [Style; 2], value: fn(&Sample) -> f64| {
                vec![
                    emulated.line("emulated chip", colour::BLUE, style, value),
                    simulated.line("simulated board", colour::RED, dashed, value),
                ]
            };
            let speed = both([Style::Line, Style::Dashed], |sample| sample.speed_cps);
            panels.push(Panel::new(format!("{}: speed, counts/s", motor.label), 110.0, speed));
            let duty = |sample: &Sample| 100.0 * sample.report.drive.duty.to_f64();
            let duty = Panel::new("duty, %", 50.0, both([Style::Step, Style::DashedStep], duty));
            panels.push(Panel { y_range: Some((0.0, 104.0)), ..duty });
        }
        Figure {
            title: self.scenario.name.clone(),
            subtitle: format!(
                "the flashed image on the emulated {}, and the same core on the simulated board",
                self.chip
            ),
            x_label: "time, s".into(),
            x_range: Some((0.0, self.scenario.duration_s)),
            panels,
        }
    }
}
