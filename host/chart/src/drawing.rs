//! Lines and texts of a drawing without axes.

use super::svg::{Anchor, Canvas, Stroke};
use super::{TEXT, colour};

impl Canvas {
    /// Draws a thin dark line through all points.
    pub fn line(&mut self, points: &[(f64, f64)]) {
        self.polyline(points, Stroke { colour: colour::INK, width: 1.6, dash: "" });
    }

    /// Draws a broad coloured line through all points, with an arrow head in the middle between the points `head` and `head + 1`.
    pub fn path(&mut self, points: &[(f64, f64)], colour: &str, dashed: bool, head: usize) {
        self.polyline(points, Stroke { colour, width: 3.4, dash: if dashed { "9 5" } else { "" } });
        if let Some(&[from, to]) = points.get(head..).and_then(|rest| rest.first_chunk()) {
            self.polygon(&head_of(from, to), colour);
        }
    }

    /// Draws a white disc with a dark rim.
    pub fn ring(&mut self, at: (f64, f64), radius: f64) {
        self.disc(at, radius + 1.6, colour::INK);
        self.disc(at, radius, "#ffffff");
    }

    /// Writes a text that begins at a point. `size` is in pixels.
    pub fn words(&mut self, at: (f64, f64), size: f64, text: &str) {
        self.text(at, Anchor::Start, size, TEXT, text);
    }

    /// Writes a text whose middle is at a point. `size` is in pixels.
    pub fn centred(&mut self, at: (f64, f64), size: f64, text: &str) {
        self.text(at, Anchor::Middle, size, TEXT, text);
    }
}

/// Returns the corners of an arrow head half way between two points, which points to the second point.
fn head_of((x0, y0): (f64, f64), (x1, y1): (f64, f64)) -> [(f64, f64); 3] {
    let length = (x1 - x0).hypot(y1 - y0).max(f64::MIN_POSITIVE);
    let (ux, uy) = ((x1 - x0) / length, (y1 - y0) / length);
    let (x, y) = (f64::midpoint(x0, x1), f64::midpoint(y0, y1));
    let corner = |along: f64, across: f64| (x + along * ux - across * uy, y + along * uy + across * ux);
    [corner(8.0, 0.0), corner(-6.0, 8.0), corner(-6.0, -8.0)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_arrow_head_points_where_its_line_goes() {
        let [tip, left, right] = head_of((0.0, 0.0), (0.0, 100.0));
        assert!(tip.1 > left.1 && left.1 == right.1 && tip.0 == 0.0);
    }
}
