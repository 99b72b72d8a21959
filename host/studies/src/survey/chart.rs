//! Curves that show how soon responses settle: the percentage of responses that have settled by a time.

use super::bare_motors::BareMotor;
use super::reference::{Figure as ReferenceFigure, Row};
use super::{Knowledge, Response, Survey, Verdict};
use crate::NamedFigure;
use chart::{Figure, Panel, Series, Style, colour};

/// Longest settling time that is drawn, in seconds.
const SHOWN_S: f64 = 4.0;

type Times = Vec<Option<f64>>;

/// Name and colour of curves with the motor configured exactly.
const CONFIGURED: (&str, &str) = (Knowledge::EXACT.name, colour::BLUE);
/// Name and colour of curves with the motor not configured.
const UNKNOWN: (&str, &str) = (Knowledge::UNKNOWN.name, colour::RED);

/// The tasks of the reference, at all periods.
pub(super) fn reference(rows: &[Row]) -> NamedFigure {
    let settling = || rows.iter().filter(|row| row.figure == ReferenceFigure::Settling);
    let configured = times(settling().flat_map(|row| &row.configured));
    let unknown = times(settling().flat_map(|row| &row.unknown));
    let panel = panel("tasks", vec![(CONFIGURED, configured), (UNKNOWN, unknown)]);
    figure("reference", "The tasks of the reference", "control periods of 1 to 100 ms", vec![panel])
}

/// Motors without a load, at all periods.
pub(super) fn cells(cells: &[BareMotor]) -> NamedFigure {
    let of_mode = |mode: &'static str| {
        let chosen = || cells.iter().filter(move |cell| cell.mode == mode);
        let configured = times(chosen().flat_map(|cell| cell.configured.iter().flatten()));
        let unknown = times(chosen().flat_map(|cell| cell.unknown.iter().flatten()));
        panel(mode, vec![(CONFIGURED, configured), (UNKNOWN, unknown)])
    };
    let panels = ["velocity", "position"].map(of_mode).into();
    figure("cells", "Every motor of the catalogue without a load", "control periods of 1 to 100 ms", panels)
}

/// Random responses that can be settled, of motors without and with dry friction.
pub(super) fn survey(survey: &Survey) -> NamedFigure {
    let of = |rough: bool| -> Vec<&Response> {
        survey.responses.iter().filter(|response| (response.friction_percent > 0.0) == rough).collect()
    };
    let panels = [("without dry friction", of(false)), ("with dry friction", of(true))];
    let panels = panels.map(|(which, responses)| {
        let colours = [colour::BLUE, colour::GREEN, colour::PURPLE, colour::RED];
        let curves = Knowledge::OF_MOTION.into_iter().zip(colours).map(|(knowledge, colour)| {
            let verdicts = responses.iter().filter_map(|response| response.verdict(knowledge));
            ((knowledge.name, colour), times(verdicts))
        });
        panel(&format!("{which}, {} responses", responses.len()), curves.collect())
    });
    let Survey { seed, scenarios, .. } = survey;
    let subtitle = format!("seed {seed}, {scenarios} scenarios; of the responses that can be settled");
    figure("survey", "Random scenarios", &subtitle, panels.into())
}

fn times<'a>(verdicts: impl Iterator<Item = &'a Verdict>) -> Times {
    verdicts.map(|verdict| verdict.settling_s).collect()
}

fn figure(name: &str, title: &str, subtitle: &str, panels: Vec<Panel>) -> NamedFigure {
    let figure = Figure {
        title: format!("{title}: how soon responses settle"),
        subtitle: format!("{subtitle}; beside each name, how many settle at all"),
        x_label: "time, s".into(),
        x_range: Some((0.0, SHOWN_S)),
        panels,
    };
    (name.to_owned(), figure)
}

fn panel(which: &str, curves: Vec<((&str, &'static str), Times)>) -> Panel {
    let curve = |((name, colour), times): ((&str, _), Times)| {
        let name = format!("{name}: {:.1} %", in_all(&times));
        Series::new(name, colour, Style::Step, cumulative(times, SHOWN_S))
    };
    let series = curves.into_iter().map(curve).collect();
    Panel { y_range: Some((0.0, 102.0)), ..Panel::new(format!("settled, %: {which}"), 260.0, series) }
}

/// Percentage of responses that settle, at any time.
fn in_all(times: &Times) -> f64 {
    100.0 * times.iter().flatten().count() as f64 / times.len().max(1) as f64
}

/// Percentage of responses that have settled, by time from 0 s to `end`. The last value is below 100 if some responses
/// have not settled by `end`.
fn cumulative(times: Times, end: f64) -> Vec<(f64, f64)> {
    let whole = times.len().max(1) as f64;
    let mut settled: Vec<f64> = times.into_iter().flatten().filter(|time| *time <= end).collect();
    settled.sort_by(f64::total_cmp);
    let percent = |count: usize| 100.0 * count as f64 / whole;
    let last = percent(settled.len());
    let steps = settled.into_iter().enumerate().map(|(index, time)| (time, percent(index + 1)));
    std::iter::once((0.0, 0.0)).chain(steps).chain([(end, last)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_rises_with_each_that_settles_and_ends_below_100_for_each_that_does_not() {
        let curve = cumulative(vec![Some(0.5), None, Some(0.2), Some(0.9), Some(2.5)], 2.0);
        assert_eq!(curve, [(0.0, 0.0), (0.2, 20.0), (0.5, 40.0), (0.9, 60.0), (2.0, 60.0)]);
        assert_eq!(cumulative(Vec::new(), 1.0), [(0.0, 0.0), (1.0, 0.0)]);
    }
}
