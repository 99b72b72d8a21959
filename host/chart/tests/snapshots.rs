//! Compares the SVG of small figures with stored files. Together the figures use all features of a figure.

mod snapshot;

use chart::{Band, Figure, Panel, Point, Series, Style, colour, fill};

fn series(name: &str, colour: &'static str, style: Style, data: &[(f64, f64)]) -> Series {
    Series::new(name, colour, style, data.to_vec())
}

fn panel(y_label: &str, series: Vec<Series>) -> Panel {
    Panel::new(y_label, 120.0, series)
}

/// Four lines that differ in their style alone, one of them with a gap.
fn styles() -> Figure {
    let data = [(0.0, 1.0), (1.0, 3.0), (2.0, 2.0), (3.0, 4.0)];
    let raised = |by: f64| data.map(|(x, y)| (x, y + by));
    let gap = [(0.0, 10.0), (1.0, 12.0), (1.5, f64::NAN), (2.0, 11.0), (3.0, 13.0)];
    Figure {
        title: "Styles".into(),
        subtitle: "a line with a gap, dashed, steps, dashed steps".into(),
        x_label: "x, s".into(),
        x_range: None,
        panels: vec![panel(
            "y, V",
            vec![
                series("line", colour::INK, Style::Line, &gap),
                series("dashed", colour::BLUE, Style::Dashed, &raised(6.0)),
                series("step", colour::RED, Style::Step, &raised(3.0)),
                series("dashed step", colour::GREEN, Style::DashedStep, &raised(0.0)),
            ],
        )],
    }
}

/// Bands that two panels share. Each band is named once, and one band extends beyond the axis.
fn bands() -> Figure {
    let bands = vec![
        Band { from: -1.0, to: 0.5, colour: fill::FORWARD, name: "forward" },
        Band { from: 0.5, to: 1.0, colour: fill::BRAKING, name: "braking" },
        Band { from: 1.0, to: 1.5, colour: fill::FORWARD, name: "forward" },
    ];
    let line = || vec![series("speed", colour::PURPLE, Style::Line, &[(0.0, -2.5), (2.0, 7.5)])];
    let upper = Panel { bands: bands.clone(), ..panel("upper", line()) };
    let lower = Panel { bands, height: 64.0, y_range: Some((-3.0, 9.0)), ..panel("lower", line()) };
    Figure {
        title: "Bands".into(),
        x_range: Some((0.0, 2.0)),
        panels: vec![upper, lower],
        ..Figure::default()
    }
}

/// Points with their names on either side, and points beyond the axis. A line that leaves the axes is clipped.
fn points() -> Figure {
    let point = |x: f64, y: f64, name: &str| Point { at: (x, y), name: name.into(), colour: colour::INK };
    Figure {
        title: "Points".into(),
        x_label: "control, steps".into(),
        x_range: Some((-100.0, 100.0)),
        panels: vec![Panel {
            y_range: Some((-1.0, 1.0)),
            points: vec![
                point(-80.0, -0.5, "S"),
                point(0.0, 0.0, "T"),
                point(-250.0, -0.8, "R"),
                point(95.0, 0.5, "G"),
            ],
            ..panel(
                "y",
                vec![series(
                    "line",
                    colour::GREY,
                    Style::Line,
                    &[(-200.0, -4.0), (-90.0, -1.8), (90.0, 1.8)],
                )],
            )
        }],
        ..Figure::default()
    }
}

/// Panels without data, with a single value, and with very small and very large numbers. Some words must be escaped.
fn edges() -> Figure {
    let line = |data: &[(f64, f64)]| vec![series("<a> & \"b\"", colour::BLUE, Style::Line, data)];
    Figure {
        title: "1 < 2 & 3 > 2".into(),
        subtitle: "</text>".into(),
        x_label: "a & b".into(),
        x_range: None,
        panels: vec![
            panel("nothing", Vec::new()),
            panel("one value", line(&[(4.0, 7.0)])),
            panel("small", line(&[(0.0, -2e-4), (10.0, 7e-4)])),
            panel("large", line(&[(0.0, -3e6), (10.0, 12e6)])),
        ],
    }
}

#[test]
fn figures_look_as_they_did() {
    let figures = [("styles", styles()), ("bands", bands()), ("points", points()), ("edges", edges())];
    snapshot::assert_all(&figures.map(|(name, figure)| (format!("{name}.svg"), figure.svg())));
}
