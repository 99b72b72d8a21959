//! Tests the contents of every figure that the program draws: words, axes, lines and points.
//!
//! A figure of curves is some 70 kB of SVG. It is too long for a review, and changes in many places with the last bit
//! of a duty. The tests of the package `chart` check how lines become SVG. Therefore the files here have for each line
//! only its style, number of samples, ends, extremes and mean, with five digits.

use crate::{COMPARISON, run, snapshot};
use chart::{Figure, Panel, Series};
use motor_hub::braking::Scheme;
use motor_hub::model::catalogue::characterised;
use simulated::scenario::Scenario;
use std::fmt::Write;
use studies::overlay::Overlay;
use studies::points::OperatingReport;
use studies::{NamedFigure, figures, report};

#[test]
fn figures_show_what_they_did() {
    let mut drawn: Vec<NamedFigure> = figures::all().expect("the catalogue has the paper's motor");
    assert_eq!(drawn.len(), 13);
    let motor = characterised("AM 60 A").expect("it is known");
    for (name, scheme, cps) in [("points-a", Scheme::A, 1360), ("points-b-backwards", Scheme::B, -1360)] {
        let report = OperatingReport::new(motor, scheme, cps, 12_000).expect("in range");
        drawn.push((name.to_owned(), report.figure()));
    }
    drawn.extend(of_runs());
    let digests = drawn.iter().map(|(name, figure)| (format!("{name}.txt"), digest(figure)));
    snapshot::assert_all(&digests.collect::<Vec<_>>());
}

/// Returns the figures of runs: of the default scenario, of the comparison, and of the overlay of two runs.
fn of_runs() -> Vec<NamedFigure> {
    let scenario = Scenario::default_one().expect("it is valid");
    let (as_set, without) = (run(&scenario), run(&scenario.without_braking()));
    let overlay = Overlay::new(scenario.clone(), "STM32F427", without.clone(), as_set.clone());
    let mut figures = report::RunReport::new(scenario, as_set, without).figures();
    figures.push(("overlay".to_owned(), overlay.figure()));
    figures.extend(COMPARISON.figures());
    figures
}

fn digest(figure: &Figure) -> String {
    let Figure { title, subtitle, x_label, x_range, panels } = figure;
    let mut out = format!("{title}\n{subtitle}\nx: {x_label}, {}\n", range(*x_range));
    for panel in panels {
        of_panel(&mut out, panel);
    }
    out
}

fn of_panel(out: &mut String, Panel { y_label, height, y_range, bands, series, points }: &Panel) {
    // Writing to a String cannot fail.
    let _ = writeln!(out, "\npanel: {y_label}, {}, {height} pixels", range(*y_range));
    for band in bands {
        let _ = writeln!(
            out,
            "  band {}: {} to {}, {}",
            band.name,
            digits(band.from),
            digits(band.to),
            band.colour
        );
    }
    for line in series {
        of_series(out, line);
    }
    for point in points {
        let _ = writeln!(out, "  point {}: {}, {}", point.name, at(point.at), point.colour);
    }
}

fn of_series(out: &mut String, Series { name, colour, style, data }: &Series) {
    let known: Vec<(f64, f64)> = data.iter().copied().filter(|(_, y)| y.is_finite()).collect();
    let _ = writeln!(
        out,
        "  {style:?} {name}, {colour}: {} samples, {} gaps",
        data.len(),
        data.len() - known.len()
    );
    let end = |sample: Option<&(f64, f64)>| sample.map_or("none".to_owned(), |&sample| at(sample));
    let by_height = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
    let mean = known.iter().map(|(_, y)| y).sum::<f64>() / known.len().max(1) as f64;
    for (what, value) in [
        ("first", end(known.first())),
        ("last", end(known.last())),
        ("lowest", end(known.iter().min_by(by_height))),
        ("highest", end(known.iter().max_by(by_height))),
        ("mean", digits(mean)),
    ] {
        let _ = writeln!(out, "    {what}: {value}");
    }
}

fn range(range: Option<(f64, f64)>) -> String {
    range.map_or("as the data".to_owned(), |(low, high)| format!("{} to {}", digits(low), digits(high)))
}

fn at((x, y): (f64, f64)) -> String {
    format!("({}, {})", digits(x), digits(y))
}

/// Returns five significant digits. A value below 1e-9 is 0.
fn digits(value: f64) -> String {
    let rounded: f64 = format!("{value:.4e}").parse().unwrap_or(value);
    if value.abs() < 1e-9 { "0".to_owned() } else { rounded.to_string() }
}
