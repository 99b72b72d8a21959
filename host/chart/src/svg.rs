//! The few SVG elements that a figure is made of, written as text.

use std::fmt::Write;

/// Font families, in the order in which a viewer looks for them.
const FONT: &str = "Ubuntu, 'DejaVu Sans', Verdana, sans-serif";

/// Position of a text relative to its point.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    /// The point is at the text's left end.
    Start,
    /// The point is at the text's middle.
    Middle,
    /// The point is at the text's right end.
    End,
}

/// Appearance of a line.
#[derive(Clone, Copy)]
pub(super) struct Stroke<'a> {
    /// Any SVG colour.
    pub colour: &'a str,
    /// Width in pixels.
    pub width: f64,
    /// Lengths of dashes and gaps in pixels; empty for a solid line.
    pub dash: &'a str,
}

/// An SVG document under construction. Coordinates are in pixels from the upper left corner.
pub(super) struct Canvas {
    body: String,
    clips: usize,
}

impl Canvas {
    /// Creates a white page of `width` x `height` pixels. Screen readers read its title.
    pub(super) fn new(width: f64, height: f64, title: &str) -> Self {
        let body = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"{FONT}\">\n\
             <title>{}</title>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>\n",
            escaped(title)
        );
        Self { body, clips: 0 }
    }

    /// Ends and returns the document.
    pub(super) fn svg(mut self) -> String {
        self.body.push_str("</svg>\n");
        self.body
    }

    /// Calls `draw`, and clips what it draws to a rectangle with the upper left corner `(x, y)`.
    pub(super) fn clipped(
        &mut self,
        (x, y): (f64, f64),
        (width, height): (f64, f64),
        draw: impl FnOnce(&mut Self),
    ) {
        self.clips += 1;
        let name = self.clips;
        self.element(format_args!(
            "<clipPath id=\"clip{name}\"><rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" \
             height=\"{height:.1}\"/></clipPath>\n<g clip-path=\"url(#clip{name})\">"
        ));
        draw(self);
        self.element(format_args!("</g>"));
    }

    /// Draws a filled rectangle with the upper left corner `(x, y)`.
    pub(super) fn rect(&mut self, (x, y): (f64, f64), (width, height): (f64, f64), fill: &str) {
        self.element(format_args!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" fill=\"{fill}\"/>"
        ));
    }

    /// Draws a filled circle.
    pub(super) fn disc(&mut self, (x, y): (f64, f64), radius: f64, fill: &str) {
        self.element(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"{fill}\"/>"));
    }

    /// Draws a triangle with its tip at `(x, y)`, which points left if `side` is -1, and right if it is 1.
    pub(super) fn arrow_head(&mut self, (x, y): (f64, f64), side: f64, fill: &str) {
        let base = x - 11.0 * side;
        let (above, below) = (y - 6.0, y + 6.0);
        self.element(format_args!(
            "<polygon points=\"{x:.1},{y:.1} {base:.1},{above:.1} {base:.1},{below:.1}\" fill=\"{fill}\"/>"
        ));
    }

    /// Draws a line through all `points`.
    pub(super) fn polyline(&mut self, points: &[(f64, f64)], stroke: Stroke) {
        let Stroke { colour, width, dash } = stroke;
        let mut list = String::with_capacity(points.len() * 12);
        for (x, y) in points {
            // Writing to a String cannot fail.
            let _ = write!(list, "{x:.1},{y:.1} ");
        }
        let dash = if dash.is_empty() { String::new() } else { format!(" stroke-dasharray=\"{dash}\"") };
        self.element(format_args!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width}\" \
             stroke-linejoin=\"round\"{dash}/>",
            list.trim_end()
        ));
    }

    /// Writes a text of `size` pixels, whose base line is at `(x, y)`.
    pub(super) fn text(&mut self, (x, y): (f64, f64), anchor: Anchor, size: f64, fill: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let text = escaped(text);
        self.element(format_args!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size}\" \
             fill=\"{fill}\">{text}</text>"
        ));
    }

    fn element(&mut self, element: std::fmt::Arguments) {
        let _ = writeln!(self.body, "{element}");
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
