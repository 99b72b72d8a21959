//! Compares the constants that the hub identifies on a simulated board with the true constants.

use crate::table::{self, Table};
use crate::with_fields;
use chart::{Figure, Panel, Series, Style, colour};
use motor_hub::motor::{Setpoint, Settings};
use motor_hub::regulator::Dynamics;
use motor_hub::regulator::identify::{Identification, Identified};
use motor_hub::units::RangeError;
use serde_json::{Value, json};
use simulated::scenario::{Configuration, Motor, Scenario, Timed};
use simulated::trace::{Sample, Trace};

/// Start of the identification, in seconds. By this time the hub has measured its battery.
const BEGIN_S: f64 = 0.5;
/// Length of a run in seconds for motors of usual inertia.
const USUAL_S: f64 = 5.0;
/// Length of a run in seconds for the heaviest motors.
const LONGEST_S: f64 = 30.0;
/// A millivolt, in volts.
const MV: f64 = 1e-3;

/// The scenario in which every motor is identified. It has no other set-points, no groups and no expectations. The
/// torques on the shafts stay. `travel_limit` is in counts.
#[must_use]
pub fn scenario(mut scenario: Scenario, travel_limit: u32) -> Scenario {
    for motor in &mut scenario.motors {
        motor.setpoints = vec![Timed { at_s: BEGIN_S, value: Setpoint::Identify { travel_limit } }];
    }
    scenario.name = "What the hub learns of its motors".into();
    scenario.duration_s = USUAL_S;
    scenario.groups.clear();
    scenario.expectations.clear();
    scenario
}

/// The scenario with a longer run for heavy motors; `None` if no identification is still running at the end of the
/// trace.
#[must_use]
pub fn longer(scenario: &Scenario, trace: &Trace) -> Option<Scenario> {
    let last = trace.ticks.last()?;
    let running =
        last.motors.iter().any(|motor| matches!(motor.report.identification, Identification::Running(_)));
    running.then(|| Scenario { duration_s: LONGEST_S, ..scenario.clone() })
}

/// The identifications of a run.
pub struct Identifications {
    scenario: Scenario,
    trace: Trace,
    configured: Vec<Settings>,
    truth: Vec<Dynamics>,
}

impl Identifications {
    /// The identifications in the trace of a scenario.
    ///
    /// # Errors
    /// If a motor's constants do not fit the firmware's range.
    pub fn new(scenario: Scenario, trace: Trace) -> Result<Self, RangeError> {
        let settings = |motor: &Motor| motor.settings();
        let configured = scenario.motors.iter().map(settings).collect::<Result<_, _>>()?;
        let truth = scenario.motors.iter().map(|motor| {
            let known = settings(&Motor { configuration: Configuration::EXACT, ..motor.clone() })?;
            known.dynamics.ok_or(RangeError::AccelerationPerVolt)
        });
        let truth = truth.collect::<Result<_, _>>()?;
        Ok(Self { scenario, trace, configured, truth })
    }

    /// The last state of each motor's identification.
    pub fn outcomes(&self) -> impl Iterator<Item = Identification> {
        let last = self.trace.ticks.last().into_iter().flat_map(|tick| &tick.motors);
        last.map(|motor| motor.report.identification)
    }

    /// Each motor with its true dynamics and its outcome.
    fn motors(&self) -> impl Iterator<Item = (&Motor, &Dynamics, Identification)> {
        let motors = self.scenario.motors.iter().zip(&self.truth);
        motors.zip(self.outcomes()).map(|((motor, truth), outcome)| (motor, truth, outcome))
    }

    /// A table for each motor.
    pub fn tables(&self) -> String {
        let mut out = String::new();
        for (motor, truth, outcome) in self.motors() {
            let title = format!("{}: {}", motor.label, motor.constants.name);
            match outcome {
                Identification::Found(found) => {
                    out.push_str(&found_table(&title, &found, Some(("true", truth))).to_string());
                }
                other => out.push_str(&format!("{title}: {}", words(other))),
            }
            out.push_str("\n\n");
        }
        out
    }

    /// The results as JSON, for programs.
    pub fn json(&self) -> Value {
        let motor = |(motor, truth, outcome): (&Motor, &Dynamics, Identification)| {
            let named =
                json!({ "label": motor.label, "motor": motor.constants.name, "true": dynamics(truth) });
            with_fields(json(outcome), named)
        };
        let motors: Vec<_> = self.motors().map(motor).collect();
        json!({ "period_ms": self.scenario.period.as_millis(), "motors": motors })
    }

    /// A chart of the measured counts, and of the counts that the identified constants predict from the voltages.
    pub fn figure(&self) -> Figure {
        let panels = self.outcomes().enumerate().map(|(index, outcome)| self.panel(index, outcome));
        Figure {
            title: "Counts measured, and predicted from what was found".into(),
            subtitle: format!(
                "+65, -65 and +29 % of the battery's voltage, control period {} ms",
                self.scenario.period.as_millis()
            ),
            x_label: "time, s".into(),
            x_range: None,
            panels: panels.collect(),
        }
    }

    fn panel(&self, index: usize, outcome: Identification) -> Panel {
        let motor = &self.scenario.motors[index];
        let driven = |sample: &&(f64, &Sample)| sample.1.report.regime.is_some();
        let samples: Vec<_> = self.trace.motor(index).collect();
        let end = samples.iter().rposition(|sample| driven(&sample)).map_or(0, |last| last + 2);
        let samples = &samples[..end.min(samples.len())];
        let measured = samples.iter().map(|(at, sample)| (*at, f64::from(sample.report.position)));
        let mut series = vec![Series::new("measured", colour::INK, Style::Line, measured)];
        if let Identification::Found(found) = outcome {
            let predicted = predicted(samples, &self.configured[index], &found.dynamics);
            series.push(Series::new("predicted", colour::RED, Style::Dashed, predicted));
        }
        let verdict = match outcome {
            Identification::Found(_) => String::new(),
            other => format!(" ({})", words(other)),
        };
        let label = format!("{}: {}, counts{verdict}", motor.label, motor.constants.name);
        Panel::new(label, 160.0, series)
    }
}

/// Predicts the counts of a motor with these dynamics. The voltages follow from the reported current and speed.
fn predicted(samples: &[(f64, &Sample)], configured: &Settings, found: &Dynamics) -> Vec<(f64, f64)> {
    const STEPS: u32 = 50;
    let ohms = MV * f64::from(configured.winding.resistance.as_milliohms())
        + 2.0 * MV * f64::from(configured.bridge.switch_mohm());
    let (b, q) = (f64::from(found.gain.to_f32()), f64::from(found.decay.to_f32()));
    let friction = b * MV * f64::from(found.friction.get());
    let (mut x, mut w) = (0.0, 0.0_f64);
    let mut data = Vec::new();
    for pair in samples.windows(2) {
        let [(at, sample), (next, _)] = pair else { continue };
        data.push((*at, x));
        let report = &sample.report;
        let emf = configured.winding.emf.emf(report.velocity).to_f64();
        let volts = MV * (f64::from(report.current.get()) * ohms + emf);
        let push = if report.regime.is_some() { b * volts } else { 0.0 };
        let dt = (next - at) / f64::from(STEPS);
        for _ in 0..STEPS {
            let before = w;
            w += (push - q * w) * dt;
            // Friction stops a motor. It does not drive a motor.
            w -= w.clamp(-friction * dt, friction * dt);
            x += f64::midpoint(before, w) * dt;
        }
    }
    data
}

/// A table of the identified constants with their standard errors. `beside` has the name and the values of other
/// constants, such as the true ones.
pub fn found_table(title: &str, found: &Identified, beside: Option<(&str, &Dynamics)>) -> Table {
    let mut headings = vec![title, "found", "error"];
    headings.extend(beside.into_iter().flat_map(|(name, _)| [name, "off by"]));
    let truth = beside.map(|(_, dynamics)| dynamics);
    let mut table = table::new(&headings, 1);
    let mut row = |name: &str, unit: &str, digits: usize, value: f64, error: String, is: Option<f64>| {
        let mut cells = vec![name.to_owned(), format!("{value:.digits$} {unit}"), error];
        if let Some(is) = is {
            let off = if is == 0.0 { "-".into() } else { format!("{:+.1} %", 100.0 * (value / is - 1.0)) };
            // The unit is in the column before.
            cells.extend([format!("{is:.digits$}"), off]);
        }
        table.add_row(cells);
    };
    let per_mille = |error: u16| format!("{:.1} %", f64::from(error) / 10.0);
    let of = |get: fn(&Dynamics) -> f64| (get(&found.dynamics), truth.map(get));
    let (b, true_b) = of(|d| d.gain.to_f32().into());
    row("acceleration per volt, b", "counts/s²/V", 1, b, per_mille(found.gain_error), true_b);
    let (q, true_q) = of(|d| d.decay.to_f32().into());
    let configured =
        |error: u16| if found.emf_is_configured { "configured".into() } else { per_mille(error) };
    row("decay, q", "/s", 3, q, configured(found.decay_error), true_q);
    let (_, ratio) = of(|d| 1e3 * f64::from(d.decay.to_f32()) / f64::from(d.gain.to_f32()));
    row(
        "back EMF and drag, q / b",
        "mV s/count",
        4,
        found.emf.to_millivolt_seconds(),
        configured(found.emf_error),
        ratio,
    );
    let (c, true_c) = of(|d| MV * f64::from(d.friction.get()));
    row("friction, c", "V", 3, c, format!("{:.3} V", MV * f64::from(found.friction_error.get())), true_c);
    table
}

/// The outcome in words, without numbers.
pub fn words(outcome: Identification) -> String {
    match outcome {
        Identification::None => "not identified".into(),
        Identification::Running(percent) => format!("under way, {percent} %"),
        Identification::Found(_) => "found".into(),
        Identification::Refused(why) => format!("refused: {why}"),
    }
}

fn dynamics(of: &Dynamics) -> Value {
    json!({
        "acceleration_per_volt": of.gain.to_f32(),
        "decay_per_s": of.decay.to_f32(),
        "friction_v": MV * f64::from(of.friction.get()),
    })
}

/// The outcome as JSON.
pub fn json(outcome: Identification) -> Value {
    let Identification::Found(found) = outcome else {
        return json!({ "outcome": words(outcome) });
    };
    json!({
        "outcome": "found",
        "found": dynamics(&found.dynamics),
        "emf_mv_s_per_count": found.emf.to_millivolt_seconds(),
        "emf_is_configured": found.emf_is_configured,
        "standard_errors": {
            "acceleration_per_volt": f64::from(found.gain_error) / 1e3,
            "decay": f64::from(found.decay_error) / 1e3,
            "emf": f64::from(found.emf_error) / 1e3,
            "friction_v": MV * f64::from(found.friction_error.get()),
        },
        "residual": f64::from(found.residual) / 1e3,
    })
}
