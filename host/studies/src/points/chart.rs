//! The points S, T, Z and G and the lines between them, as one panel.

use ::chart::{Panel, Point, Series, Style, colour};

/// Largest control value, as a fraction of full scale.
const REACH: f64 = 1.0;

/// How the points of a motor are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Look {
    /// True if the motor turns counter-clockwise. Then the labels 9/8 and 6/2 are exchanged. The colours of the regimes
    /// are not exchanged.
    pub(crate) counter_clockwise: bool,
    /// True if there is no braking regime between T and Z.
    pub(crate) jump: bool,
    /// Height of the panel in pixels.
    pub(crate) height: f64,
}

/// Draws the lines from S via T and Z to G within the control range. `points` are in this order.
pub(crate) fn panel(y_label: String, points: [Point; 4], look: Look) -> Panel {
    let [s, t, z, g] = &points;
    let [forward, reverse] = if look.counter_clockwise { ["6/2", "9/8"] } else { ["9/8", "6/2"] };
    let line = |name: String, colour, from: &Point, to: &Point| {
        Series::new(name, colour, Style::Line, within_reach(from.at, to.at))
    };
    let between = if look.jump {
        line("a jump".into(), colour::GREY, t, z)
    } else {
        line("braking (5/0)".into(), colour::BRAKING, t, z)
    };
    let mut series = vec![
        line(format!("reverse ({reverse})"), colour::REVERSE, s, t),
        between,
        line(format!("forward ({forward})"), colour::FORWARD, z, g),
    ];
    series.retain(|line| !line.data.is_empty());
    let largest = series.iter().flat_map(|s| &s.data).map(|p| p.1.abs()).fold(0.0, f64::max);
    let y_range = Some((-1.15 * largest, 1.15 * largest));
    Panel { y_range, points: points.into(), ..Panel::new(y_label, look.height, series) }
}

/// The part of a line from `a` to `b` that lies within the control range, ascending.
fn within_reach(a: (f64, f64), b: (f64, f64)) -> Vec<(f64, f64)> {
    let (a, b) = if a.0 <= b.0 { (a, b) } else { (b, a) };
    let (low, high) = (a.0.max(-REACH), b.0.min(REACH));
    if low > high {
        return Vec::new();
    }
    if a.0 == b.0 {
        return vec![a, b];
    }
    let y = |x: f64| a.1 + (b.1 - a.1) * (x - a.0) / (b.0 - a.0);
    vec![(low, y(low)), (high, y(high))]
}
