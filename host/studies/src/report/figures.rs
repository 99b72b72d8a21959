//! The charts of a run: one for each motor, and one of all motors with and without braking regime.

use super::{RunReport, WITHOUT};
use crate::measures::regime_of;
use crate::points::{CONTROL_RANGE, fraction};
use crate::{Lines, NamedFigure};
use chart::{Band, Figure, Panel, Series, Style, colour, fill};
use motor_hub::braking::Regime;
use motor_hub::motor::Setpoint;
use simulated::scenario::{Motor, Scenario};
use simulated::scheme;
use simulated::trace::{Sample, Tick, Trace};

/// Label of panels with the motor's current.
const CURRENT: &str = "motor current, A, mean of a control period";

impl RunReport {
    /// A chart of each motor, and one of all motors with and without a braking regime.
    pub fn figures(&self) -> Vec<NamedFigure> {
        let motors = self.scenario.motors.iter().zip(&self.measures).enumerate();
        let single = motors.map(|(index, (motor, [measures, _]))| {
            let figure = of_motor(&self.scenario, &self.as_set, index, motor, measures.regulator);
            (format!("motor-{index}-{}", file_name(&motor.label)), figure)
        });
        single.chain([("comparison".to_owned(), compared(self))]).collect()
    }
}

fn of_motor(scenario: &Scenario, trace: &Trace, index: usize, motor: &Motor, regulator: &str) -> Figure {
    let lines = Lines { trace, motor: index };
    let bands = regimes(scenario, trace, index);
    let over_bands = |panel: Panel| Panel { bands: bands.clone(), ..panel };
    let mut panels = Vec::new();
    if has_position(scenario, index) {
        let goal = lines.line("set-point", colour::RED, Style::DashedStep, position_goal);
        let position = lines.line("position", colour::INK, Style::Line, |s| s.counts as f64);
        panels.push(over_bands(Panel::new("position, counts", 150.0, vec![goal, position])));
    }
    panels.push(over_bands(Panel::new("speed, counts/s", 170.0, speed_lines(motor, lines))));
    let control = lines.line("control", colour::BLUE, Style::Step, |s| fraction(s.control.get()));
    let control = Panel::new("control", 130.0, vec![control]);
    panels.push(over_bands(Panel { y_range: Some(CONTROL_RANGE), ..control }));
    let duty = lines.line("duty", colour::INK, Style::Step, |s| 100.0 * s.report.drive.duty.to_f64());
    let duty = Panel::new("duty, %", 80.0, vec![duty]);
    panels.push(over_bands(Panel { y_range: Some((0.0, 104.0)), ..duty }));
    panels.push(over_bands(Panel::new(CURRENT, 110.0, currents(lines))));
    if motor.torques.iter().any(|t| t.value != 0.0) {
        let torque = lines.line("torque", colour::INK, Style::Step, |s| s.torque_nm);
        panels.push(Panel::new("external torque on the output shaft, N m", 60.0, vec![torque]));
    }
    panels.push(battery(trace));
    Figure {
        title: format!("{}: {}", motor.label, motor.constants.name),
        subtitle: format!(
            "{}; {}, {regulator}, control period {} ms, load {} kg m\u{b2}",
            scenario.name,
            scheme::describe(motor.scheme),
            scenario.period.as_millis(),
            significant(motor.load.inertia_after.0),
        ),
        x_label: "time, s".into(),
        x_range: Some((0.0, scenario.duration_s)),
        panels,
    }
}

/// The current, and the observed load current if the hub reports it.
fn currents(lines: Lines) -> Vec<Series> {
    let current = lines.line("current", colour::BLUE, Style::Step, |s| s.flow.mean_current().0);
    let load = |s: &Sample| s.report.load.map_or(f64::NAN, |load| f64::from(load.get()) / 1e3);
    let observed = lines.trace.motor(lines.motor).any(|(_, sample)| sample.report.load.is_some());
    let load = observed.then(|| lines.line("load, observed", colour::RED, Style::Step, load));
    [current].into_iter().chain(load).collect()
}

fn speed_lines(motor: &Motor, lines: Lines) -> Vec<Series> {
    let speed = lines.line("speed", colour::INK, Style::Line, |s| s.speed_cps);
    if has_velocity(motor) {
        vec![lines.line("set-point", colour::RED, Style::DashedStep, velocity_goal), speed]
    } else {
        vec![speed]
    }
}

fn has_velocity(motor: &Motor) -> bool {
    motor.setpoints.iter().any(|s| matches!(s.value, Setpoint::Velocity(_)))
}

/// True if the motor has position set-points, of its own or of a group.
fn has_position(scenario: &Scenario, index: usize) -> bool {
    let position = |motor: &Motor| {
        motor.setpoints.iter().any(|setpoint| matches!(setpoint.value, Setpoint::Position { .. }))
    };
    scenario.motors.get(index).is_some_and(position)
        || scenario.groups.iter().any(|group| group.motors.contains(&index))
}

fn compared(comparison: &RunReport) -> Figure {
    let mut panels = Vec::new();
    for (index, motor) in comparison.scenario.motors.iter().enumerate() {
        let without = Lines { trace: &comparison.without, motor: index };
        let as_set = Lines { trace: &comparison.as_set, motor: index };
        let name = scheme::describe(motor.scheme);
        let both = |value: fn(&Sample) -> f64, style| {
            vec![
                without.line(WITHOUT, colour::RED, style, value),
                as_set.line(&name, colour::BLUE, style, value),
            ]
        };
        let goal =
            |value: fn(&Sample) -> f64| as_set.line("set-point", colour::INK, Style::DashedStep, value);
        let (what, goals, motion) = if has_position(&comparison.scenario, index) {
            ("position, counts", vec![goal(position_goal)], both(|s| s.counts as f64, Style::Line))
        } else if has_velocity(motor) {
            ("speed, counts/s", vec![goal(velocity_goal)], both(|s| s.speed_cps, Style::Line))
        } else {
            ("speed, counts/s", Vec::new(), both(|s| s.speed_cps, Style::Line))
        };
        let motion = goals.into_iter().chain(motion).collect();
        panels.push(Panel::new(format!("{}: {what}", motor.label), 130.0, motion));
        let current = both(|s| s.flow.mean_current().0, Style::Step);
        panels.push(Panel::new(format!("{}: {CURRENT}", motor.label), 100.0, current));
    }
    Figure {
        title: "With and without proportional braking".into(),
        subtitle: format!(
            "{}; the same scenario twice, control period {} ms",
            comparison.scenario.name,
            comparison.scenario.period.as_millis()
        ),
        x_label: "time, s".into(),
        x_range: Some((0.0, comparison.scenario.duration_s)),
        panels,
    }
}

fn battery(trace: &Trace) -> Panel {
    let line = |name: &str, colour, value: &dyn Fn(&Tick) -> f64| {
        Series::new(name, colour, Style::Line, trace.ticks.iter().map(|tick| (tick.at_s, value(tick))))
    };
    let series = vec![
        line("at its terminals", colour::GREY, &|t| t.battery_v),
        line("as measured", colour::GREEN, &|t| t.measured_v.unwrap_or(f64::NAN)),
    ];
    Panel::new("battery, V", 80.0, series)
}

/// The speed set-point of a sample in counts/s; not a number for other set-points.
pub(crate) fn velocity_goal(sample: &Sample) -> f64 {
    match sample.report.setpoint {
        Setpoint::Velocity(cps) => cps.to_f64(),
        Setpoint::Follow(reference) => reference.speed.to_f64(),
        _ => f64::NAN,
    }
}

fn position_goal(sample: &Sample) -> f64 {
    match sample.report.setpoint {
        Setpoint::Position { target, .. } => target.into(),
        Setpoint::Follow(reference) => reference.position.into(),
        _ => f64::NAN,
    }
}

/// A band for each stretch of a regime; none while the motor coasts.
fn regimes(scenario: &Scenario, trace: &Trace, index: usize) -> Vec<Band> {
    let regime = |tick: &Tick| tick.motors.get(index).and_then(|sample| regime_of(&sample.report));
    let mut bands: Vec<Band> = Vec::new();
    for run in trace.ticks.chunk_by(|a, b| regime(a) == regime(b)) {
        let Some(first) = run.first() else { continue };
        // A band ends at the tick at which the next regime begins.
        if let Some(last) = bands.last_mut().filter(|last| last.to > first.at_s) {
            last.to = first.at_s;
        }
        let Some(regime) = regime(first) else { continue };
        let colour = match regime {
            Regime::Forward => fill::FORWARD,
            Regime::Braking => fill::BRAKING,
            Regime::Reverse => fill::REVERSE,
        };
        bands.push(Band { from: first.at_s, to: scenario.duration_s, colour, name: regime.name() });
    }
    bands
}

/// Four significant digits without trailing zeros.
pub(crate) fn significant(value: f64) -> String {
    let rounded: f64 = format!("{value:.3e}").parse().unwrap_or(value);
    rounded.to_string()
}

/// A label as a part of a file name: letters in lower case and digits. All other characters become hyphens.
fn file_name(label: &str) -> String {
    label.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' }).collect()
}
