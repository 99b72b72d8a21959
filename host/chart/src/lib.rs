//! Charts: stacked panels over one horizontal axis, as SVG text.
//!
//! A [`Figure`] has the contents of a chart. The layout follows from the number of panels. The legend of each panel is in a
//! column on the right, so no label covers data. This package is independent of motors.
//!
//! ```
//! use chart::{Figure, Panel, Series, Style, colour};
//!
//! let line = Series::new("y", colour::BLUE, Style::Line, [(0.0, 1.0), (1.0, 2.0)]);
//! let panel = Panel::new("y, V", 100.0, vec![line]);
//! let figure = Figure { title: "A line".into(), panels: vec![panel], ..Figure::default() };
//! assert!(figure.svg().starts_with("<svg"));
//! ```
#![forbid(unsafe_code)]

#[cfg(test)]
mod colour_blindness;
mod scale;
mod svg;

use scale::Scale;
use svg::{Anchor, Canvas, Stroke};

/// Colours for lines. Blue, red and green are from Okabe and Ito's set. Readers with deuteranopia (red-green blindness) can
/// distinguish ink, blue, red and green. They can also distinguish ink and the three regimes. Tests check both.
pub mod colour {
    /// Near black.
    pub const INK: &str = "#222222";
    /// Blue.
    pub const BLUE: &str = "#0072b2";
    /// Vermilion.
    pub const RED: &str = "#d55e00";
    /// Bluish green.
    pub const GREEN: &str = "#009e73";
    /// Reddish purple.
    pub const PURPLE: &str = "#aa4499";
    /// Grey.
    pub const GREY: &str = "#888888";
    /// The forward regime: the edge of its band on the dashboard's page.
    pub const FORWARD: &str = "#2f87bd";
    /// The braking regime: the colour of its band on the dashboard's page.
    pub const BRAKING: &str = "#e69f00";
    /// The reverse regime: the edge of its band on the dashboard's page.
    pub const REVERSE: &str = "#a8497e";
}

/// Light colours of the regimes' bands behind lines: the dashboard's colours mixed with white. Readers with deuteranopia
/// (red-green blindness) can distinguish the bands from each other and from the page.
pub mod fill {
    /// The forward regime: 40 % of sky blue, #56b4e9.
    pub const FORWARD: &str = "#bbe1f6";
    /// The braking regime: 45 % of orange, #e69f00.
    pub const BRAKING: &str = "#f4d48c";
    /// The reverse regime: 85 % of reddish purple, #cc79a7. Readers with deuteranopia cannot distinguish a paler purple from
    /// the blue.
    pub const REVERSE: &str = "#d48db4";
}

/// Width of a figure, in pixels.
const WIDTH: f64 = 1200.0;
/// Distance of the vertical axes from the left edge, in pixels.
const LEFT: f64 = 84.0;
/// Width of the legend's column with the gap before it, in pixels.
const LEGEND: f64 = 232.0;
/// Height of title and subtitle, in pixels.
const TITLE: f64 = 58.0;
/// Height of the space above each panel for its label, in pixels.
const HEADING: f64 = 28.0;
/// Height of the space below the last panel for the horizontal axis, in pixels.
const FOOT: f64 = 56.0;
/// Approximate largest number of marks on the horizontal axis.
const X_MARKS: usize = 10;
const GRID: Stroke = Stroke { colour: "#d4d4d4", width: 1.0, dash: "" };
const FRAME: Stroke = Stroke { colour: "#707070", width: 1.0, dash: "" };
const TEXT: &str = "#1a1a1a";

/// One picture.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Title: what the figure shows.
    pub title: String,
    /// Subtitle: the conditions of the data.
    pub subtitle: String,
    /// Quantity and unit of the horizontal axis.
    pub x_label: String,
    /// Ends of the horizontal axis. `None` stands for round numbers around the data.
    pub x_range: Option<(f64, f64)>,
    /// Panels from top to bottom.
    pub panels: Vec<Panel>,
}

/// One pair of axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Quantity and unit of the vertical axis.
    pub y_label: String,
    /// Height of the plotting area in pixels.
    pub height: f64,
    /// Ends of the vertical axis. `None` stands for round numbers around the data.
    pub y_range: Option<(f64, f64)>,
    /// Coloured bands behind the lines.
    pub bands: Vec<Band>,
    /// Lines of the panel.
    pub series: Vec<Series>,
    /// Single labelled points.
    pub points: Vec<Point>,
}

/// A coloured band behind the lines, over a range of the horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Band {
    /// Beginning of the range on the horizontal axis.
    pub from: f64,
    /// End of the range on the horizontal axis.
    pub to: f64,
    /// Light colour of the band.
    pub colour: &'static str,
    /// Its name in the legend.
    pub name: &'static str,
}

/// How the samples of a series are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// Straight from sample to sample.
    Line,
    /// As `Line`, dashed. A dashed line shows requested or predicted values beside measured values.
    Dashed,
    /// Each value holds until the next sample.
    Step,
    /// As `Step`, dashed. It shows set-points.
    DashedStep,
}

/// One line. A value that is not a number makes a gap in the line.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name in the legend.
    pub name: String,
    /// Any SVG colour.
    pub colour: &'static str,
    /// How samples are joined.
    pub style: Style,
    /// Pairs of x and y, x ascending.
    pub data: Vec<(f64, f64)>,
}

/// A point with its name. A point beyond the ends of the horizontal axis is an arrow head at the edge, and the legend has its
/// position.
#[derive(Clone, Debug)]
pub struct Point {
    /// Coordinates x and y, in data units.
    pub at: (f64, f64),
    /// Name of the point.
    pub name: String,
    /// Any SVG colour.
    pub colour: &'static str,
}

impl Panel {
    /// Creates a panel with lines, and a height in pixels.
    pub fn new(y_label: impl Into<String>, height: f64, series: Vec<Series>) -> Self {
        Self { y_label: y_label.into(), height, series, ..Self::default() }
    }
}

impl Series {
    /// Creates a line with its name in the legend.
    pub fn new(
        name: impl Into<String>,
        colour: &'static str,
        style: Style,
        data: impl IntoIterator<Item = (f64, f64)>,
    ) -> Self {
        Self { name: name.into(), colour, style, data: data.into_iter().collect() }
    }
}

impl Figure {
    /// Returns the figure as an SVG document.
    pub fn svg(&self) -> String {
        let height = TITLE + FOOT + self.panels.iter().map(|p| HEADING + p.height).sum::<f64>();
        let right = WIDTH - LEGEND;
        let mut canvas = Canvas::new(WIDTH, height, &self.title);
        canvas.text((LEFT, 30.0), Anchor::Start, 21.0, TEXT, &self.title);
        canvas.text((LEFT, 50.0), Anchor::Start, 13.5, "#505050", &self.subtitle);

        let data = || self.panels.iter().flat_map(Panel::coordinates);
        let x = match self.x_range {
            Some(range) => Scale::exact(range, (LEFT, right), X_MARKS),
            None => Scale::rounded(extent(data().map(|p| p.0)), (LEFT, right), X_MARKS),
        };
        let mut top = TITLE;
        let mut named_bands = Vec::new();
        for panel in &self.panels {
            top += HEADING;
            panel.draw(&mut canvas, &x, (LEFT, right), top);
            panel.legend(&mut canvas, &x, (right + 18.0, top), &mut named_bands);
            top += panel.height;
        }
        for tick in x.ticks() {
            let at = (x.pixel(tick.value), top + 19.0);
            canvas.text(at, Anchor::Middle, 13.0, TEXT, &tick.label);
        }
        let middle = ((LEFT + right) / 2.0, top + 42.0);
        canvas.text(middle, Anchor::Middle, 14.0, TEXT, &self.x_label);
        canvas.svg()
    }
}

impl Panel {
    fn coordinates(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let lines = self.series.iter().flat_map(|s| s.data.iter().copied());
        lines.chain(self.points.iter().map(|p| p.at))
    }

    fn draw(&self, canvas: &mut Canvas, x: &Scale, (left, right): (f64, f64), top: f64) {
        let bottom = top + self.height;
        let marks = (self.height / 32.0).clamp(2.0, 8.0) as usize;
        let y = match self.y_range {
            Some(range) => Scale::exact(range, (bottom, top), marks),
            None => Scale::rounded(extent(self.coordinates().map(|p| p.1)), (bottom, top), marks),
        };

        canvas.text((left, top - 8.0), Anchor::Start, 14.0, TEXT, &self.y_label);
        for band in &self.bands {
            let from = x.pixel(band.from).clamp(left, right);
            let to = x.pixel(band.to).clamp(left, right);
            canvas.rect((from, top), (to - from, self.height), band.colour);
        }
        for tick in x.ticks() {
            let at = x.pixel(tick.value);
            canvas.polyline(&[(at, top), (at, bottom)], GRID);
        }
        for tick in y.ticks() {
            let at = y.pixel(tick.value);
            let zero = tick.value == 0.0;
            canvas.polyline(&[(left, at), (right, at)], if zero { FRAME } else { GRID });
            canvas.text((left - 8.0, at + 4.5), Anchor::End, 13.0, TEXT, &tick.label);
        }
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        canvas.polyline(&corners, FRAME);
        canvas.clipped((left, top), (right - left, self.height), |canvas| {
            // Dashed lines are drawn over the others, which can be seen between the dashes.
            let (above, below): (Vec<&Series>, Vec<&Series>) =
                self.series.iter().partition(|series| series.is_dashed());
            for series in below.into_iter().chain(above) {
                for run in series.runs(x, &y) {
                    canvas.polyline(&run, series.stroke());
                }
            }
        });
        for point in &self.points {
            let at = (x.pixel(point.at.0), y.pixel(point.at.1));
            let side = point.beyond(x);
            if side != 0.0 {
                let edge = (if side < 0.0 { left } else { right }, at.1.clamp(top, bottom));
                canvas.arrow_head(edge, side, point.colour);
                continue;
            }
            canvas.disc(at, 5.0, point.colour);
            // The name is below the point and to its right, where a rising line does not cross it. At the right edge the name is
            // above the point and to its left.
            let ((dx, dy), anchor) =
                if at.0 > right - 160.0 { ((-9.0, -9.0), Anchor::End) } else { ((9.0, 20.0), Anchor::Start) };
            canvas.text((at.0 + dx, at.1 + dy), anchor, 16.0, TEXT, &point.name);
        }
    }

    /// Draws the legend: the lines, the points beyond the axis, and the bands that no upper panel has named.
    fn legend(&self, canvas: &mut Canvas, x: &Scale, (left, top): (f64, f64), named: &mut Vec<&str>) {
        let mut row = top + 10.0;
        let mut entry = |canvas: &mut Canvas, name: &str| {
            canvas.text((left + 32.0, row + 4.5), Anchor::Start, 13.0, TEXT, name);
            row += 19.0;
            row - 19.0
        };
        for series in &self.series {
            let at = entry(canvas, &series.name);
            canvas.polyline(&[(left, at), (left + 24.0, at)], series.stroke());
        }
        for point in self.points.iter().filter(|point| point.beyond(x) != 0.0) {
            let label = format!("{}: beyond, at {:.0}", point.name, point.at.0).replace('-', "\u{2212}");
            let at = entry(canvas, &label);
            canvas.arrow_head((left + 12.0, at), point.beyond(x), point.colour);
        }
        for band in &self.bands {
            if !named.contains(&band.name) {
                named.push(band.name);
                let at = entry(canvas, band.name);
                canvas.rect((left, at - 6.0), (24.0, 12.0), band.colour);
            }
        }
    }
}

impl Point {
    /// Returns -1 if the point is left of the horizontal axis, 1 if it is right of the axis, and otherwise 0.
    fn beyond(&self, x: &Scale) -> f64 {
        let (low, high) = x.range();
        match self.at.0 {
            at if at < low => -1.0,
            at if at > high => 1.0,
            _ => 0.0,
        }
    }
}

impl Series {
    fn is_dashed(&self) -> bool {
        matches!(self.style, Style::Dashed | Style::DashedStep)
    }

    fn stroke(&self) -> Stroke<'_> {
        let dash = if self.is_dashed() { "6 4" } else { "" };
        Stroke { colour: self.colour, width: 1.8, dash }
    }

    /// Returns the pieces of the line between its gaps, in pixels. Points that the page cannot show are left out.
    fn runs(&self, x: &Scale, y: &Scale) -> Vec<Vec<(f64, f64)>> {
        let shown = |&(at, value): &(f64, f64)| {
            let (low, high) = x.range();
            value.is_finite() && (low..=high).contains(&at)
        };
        self.data
            .split(|sample| !shown(sample))
            .filter(|run| !run.is_empty())
            .map(|run| {
                let pixels = run.iter().map(|&(at, value)| (x.pixel(at), y.pixel(value)));
                let thin = thinned(pixels);
                if matches!(self.style, Style::Step | Style::DashedStep) { stepped(&thin) } else { thin }
            })
            .collect()
    }
}

/// Keeps of the points in each half pixel only the first, the lowest, the highest and the last one.
fn thinned(points: impl Iterator<Item = (f64, f64)>) -> Vec<(f64, f64)> {
    let column = |p: &(f64, f64)| (p.0 * 2.0).floor();
    let points: Vec<_> = points.collect();
    points.chunk_by(|a, b| column(a) == column(b)).flat_map(outline).collect()
}

/// Returns the first, the lowest, the highest and the last of `points` in their order, each of them once.
fn outline(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let by_height = |a: &(usize, &(f64, f64)), b: &(usize, &(f64, f64))| a.1.1.total_cmp(&b.1.1);
    let low = points.iter().enumerate().min_by(by_height).map(|p| p.0);
    let high = points.iter().enumerate().max_by(by_height).map(|p| p.0);
    let last = points.len().saturating_sub(1);
    let kept = |n: usize| n == 0 || n == last || Some(n) == low || Some(n) == high;
    points.iter().enumerate().filter(|(n, _)| kept(*n)).map(|(_, p)| *p).collect()
}

/// Adds the corners of a line that holds each value until the next sample.
fn stepped(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let next = points.iter().skip(1);
    let corners = points.iter().zip(next).flat_map(|(a, b)| [*a, (b.0, a.1)]);
    corners.chain(points.last().copied()).collect()
}

/// Returns the lowest and the highest finite value, or infinities if there is none.
fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values
        .filter(|v| v.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_peaks_and_both_ends() {
        let points = (0..=1000).map(|n| (n as f64 / 100.0, if n == 333 { 9.0 } else { 0.0 }));
        let thin = thinned(points);
        assert!(thin.len() < 100, "{} points are left", thin.len());
        assert!(thin.contains(&(3.33, 9.0)));
        assert_eq!((thin[0].0, thin[thin.len() - 1].0), (0.0, 10.0));
    }
}
