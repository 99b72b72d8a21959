//! The runs as charts: one for each task and round.

use super::row::Row;
use super::variant::Variant;
use super::{Comparison, Round, TaskResult};
use crate::NamedFigure;
use crate::report::figures::velocity_goal;
use chart::{Figure, Panel, Series, Style, colour};
use motor_hub::braking::{DutyRule, Scheme};
use motor_hub::regulator::Kind;
use simulated::trace::Sample;

impl Comparison {
    /// A chart of each task in each round.
    pub fn figures(&self) -> Vec<NamedFigure> {
        let of_round = |round: &'_ Round| -> Vec<_> {
            let name = |result: &TaskResult| format!("{}-{}", result.task.key, round.tuning.key);
            round.tasks.iter().map(|result| (name(result), figure(round, result))).collect()
        };
        self.rounds.iter().flat_map(of_round).collect()
    }
}

fn figure(round: &Round, result: &TaskResult) -> Figure {
    let speed = |s: &Sample| s.speed_cps;
    let current = |s: &Sample| s.flow.mean_current().0;
    let panels = VARIANT_GROUPS.into_iter().flat_map(|(name, shown)| {
        let panel = |y_label: &str, height, goal: bool, value: fn(&Sample) -> f64, style| {
            Panel::new(format!("{y_label}: {name}"), height, lines(result, goal, shown, value, style))
        };
        [
            panel("speed, counts/s", 200.0, true, speed, Style::Line),
            panel("motor current, A, mean of a control period", 130.0, false, current, Style::Step),
        ]
    });
    Figure {
        title: result.task.what.clone(),
        subtitle: format!(
            "NeveRest 60, {}, control period 50 ms, {}; where lines coincide, the last one of the legend shows",
            load(result),
            round.tuning.key_in_words
        ),
        x_label: "time, s".into(),
        x_range: Some(((result.task.event_s - 0.25).max(0.0), result.task.scenario.duration_s)),
        panels: panels.collect(),
    }
}

/// Name of a group of variants, and the test for its members.
pub(super) type VariantGroup = (&'static str, fn(&Variant) -> bool);

/// The groups of variants that have a panel or a table of their own.
pub(super) const VARIANT_GROUPS: [VariantGroup; 3] = [
    ("PID, linear duty", |variant| by_pid(variant, DutyRule::LinearDuty)),
    ("PID, linear current", |variant| by_pid(variant, DutyRule::LinearCurrent)),
    ("the motor's model", |variant| variant.regulator == Kind::Model),
];

/// True for PID with this duty rule, and, for comparison, for PID without a braking regime.
fn by_pid(variant: &Variant, duty: DutyRule) -> bool {
    variant.regulator == Kind::Pid && (variant.duty == duty || variant.scheme == Scheme::ForwardReverse)
}

fn load(result: &TaskResult) -> String {
    let inertia = result.task.scenario.motors.first().map_or(0.0, |motor| motor.load.inertia_after.0);
    if inertia > 0.0 { format!("load {inertia} kg m\u{b2}") } else { "no load".to_owned() }
}

/// A line for each variant of a group, and with `goal` a line for the set-point.
fn lines(
    result: &TaskResult,
    goal: bool,
    wanted: fn(&Variant) -> bool,
    value: fn(&Sample) -> f64,
    style: Style,
) -> Vec<Series> {
    let from_s = (result.task.event_s - 0.3).max(0.0);
    let data = |row: &Row, value: fn(&Sample) -> f64| -> Vec<(f64, f64)> {
        row.trace.motor(0).filter(|(at, _)| *at >= from_s).map(|(at, sample)| (at, value(sample))).collect()
    };
    let goal = result.rows.first().filter(|_| goal);
    let goal =
        goal.map(|row| Series::new("set-point", colour::INK, Style::DashedStep, data(row, velocity_goal)));
    let shown = Variant::ALL.into_iter().zip(&result.rows).filter(|(variant, _)| wanted(variant));
    let lines = shown.map(|(variant, row)| {
        let colour = match variant.scheme {
            Scheme::ForwardReverse => colour::GREY,
            Scheme::A => colour::BLUE,
            Scheme::B => colour::RED,
            Scheme::C => colour::GREEN,
            Scheme::D(_) => colour::PURPLE,
        };
        Series::new(variant.in_words(), colour, style, data(row, value))
    });
    goal.into_iter().chain(lines).collect()
}
